"""From CoP and foot references to joint set-points."""
