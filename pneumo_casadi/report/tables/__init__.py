"""Tables of results as data."""
