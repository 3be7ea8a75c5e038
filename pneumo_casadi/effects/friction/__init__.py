"""Effects of friction."""
