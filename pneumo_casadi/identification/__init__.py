"""Identification: from a case to parameters, warnings and result files."""
