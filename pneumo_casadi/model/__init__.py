"""The model: effects and junctions, balances, axes, discrete time and simulation."""
