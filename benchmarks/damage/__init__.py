"""Kinds of damage to the files of a case and of a result."""
