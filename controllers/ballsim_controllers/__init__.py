"""What runs on the robot: from sensor readings to joint position targets."""
