"""What a second of simulation costs, beside the bare physics of the same scene."""
