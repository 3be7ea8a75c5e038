"""Effects of the air between supply, valves, chambers and exhaust."""
