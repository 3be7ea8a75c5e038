"""Checks of a recording against its bench."""
