"""State of robot and ball from the sensors."""
