"""Effects of the valves."""
