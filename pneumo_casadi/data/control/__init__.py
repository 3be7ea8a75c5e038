"""The law of a controller from sample to sample."""
