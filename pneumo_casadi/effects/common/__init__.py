"""Parts that several effects are made of."""
