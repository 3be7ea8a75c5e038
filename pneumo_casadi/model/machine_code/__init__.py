"""Functions as machine code: compiled once, kept in a cache, called with arrays."""
