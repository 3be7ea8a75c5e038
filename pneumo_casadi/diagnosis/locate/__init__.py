"""Where model and measurement disagree: balance, junction, regime."""
