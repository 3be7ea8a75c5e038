"""Checks of fitted parameters against geometry and data sheet."""
