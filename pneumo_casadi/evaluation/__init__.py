"""Many diagnoses: batches of cases, and the sealed check."""
