"""Balance: pole-placed feedback and observers of the wheeled LIP."""
