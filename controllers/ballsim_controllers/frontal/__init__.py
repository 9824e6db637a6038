"""Frontal plane, which the paper leaves out."""
