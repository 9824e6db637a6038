"""What errors of the state estimate the noise figures of the sensors lead to."""
