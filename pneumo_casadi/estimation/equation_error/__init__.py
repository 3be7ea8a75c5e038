"""Equation error: parameters fitted to the balances along the smoothed measured motion."""
