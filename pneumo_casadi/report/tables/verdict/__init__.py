"""Tables of what a verdict rests on: checks of parameters, estimates of the fits."""
