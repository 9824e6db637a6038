"""A run at real time, with an operator: viewer, clock, instructions."""
