"""Figures of designs, of the sensitivity to the flow map, and of the sealed check."""
