"""Humanoids that stand and walk on a free rolling ball, in full MuJoCo physics."""

__version__ = "0.1.0"
