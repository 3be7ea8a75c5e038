"""Estimators: weighted least squares, output error, equation error; their uncertainty."""
