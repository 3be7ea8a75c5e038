"""Readers of tables: CSV, Parquet and MAT files, with names and units of their own."""
