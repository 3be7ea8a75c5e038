"""Lags and delays that are regular where they vanish."""
