"""Figures and tables of runs that are read back from their recordings."""
