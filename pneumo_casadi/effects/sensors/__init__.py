"""Effects of the sensors."""
