"""What a diagnosis starts from: usable records, the nominal axis, finished fits on disk."""
