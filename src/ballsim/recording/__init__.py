"""Recorders: what is kept of a run for the eye."""
