"""Optimal estimation for pneumatic servo axes, from recordings to parameters with intervals."""

__version__ = "0.1.0"
