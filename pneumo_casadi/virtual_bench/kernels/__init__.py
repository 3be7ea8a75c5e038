"""Kernels of the virtual bench: the physics, compiled."""
