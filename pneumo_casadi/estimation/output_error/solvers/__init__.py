"""Solvers of the shooting problem: Gauss-Newton, Levenberg-Marquardt, IPOPT."""
