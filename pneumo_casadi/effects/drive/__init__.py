"""Effects of the drive of a force-driven axis."""
