"""Where simulation and reality part: balance, junction, regime."""
