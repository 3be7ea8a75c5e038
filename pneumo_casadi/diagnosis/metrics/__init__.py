"""Sizes of residuals and gaps, and the findings that carry them."""
