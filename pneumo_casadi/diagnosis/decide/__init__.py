"""From a selection to a verdict."""
