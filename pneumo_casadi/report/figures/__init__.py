"""Figures: one file a family, one style."""
