"""Choice of the form of the flow map and of its degrees, by the error on withheld points."""
