"""Readers of recordings from CSV, Parquet and MAT files.

A column becomes a channel in SI units in this chain: file -> table of numbers (`tables`, `mat`) ->
channel, unit and offset of each column as ``columns.json`` states them (`columns`, `units`) ->
``Column.to_si``, for example bar to pascals -> `Recording` (`recordings.read_recording`).
"""
