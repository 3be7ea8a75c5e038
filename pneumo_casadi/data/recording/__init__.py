"""Recordings: channels, clock, and the record itself."""
