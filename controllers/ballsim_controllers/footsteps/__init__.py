"""Footstep layer: when a foot lifts, how it swings, when and where it lands."""
