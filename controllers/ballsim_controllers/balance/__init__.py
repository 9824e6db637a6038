"""Balance layer: feedback gains, observers, and the ideal CoP they ask for."""
