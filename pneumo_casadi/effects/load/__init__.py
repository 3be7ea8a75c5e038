"""Effects of the load that the piston moves."""
