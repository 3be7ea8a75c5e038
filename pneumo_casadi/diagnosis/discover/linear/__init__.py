"""A fitted model, linearised along its records, with the drivers that terms may act by."""
