"""What a simulation accepts: arguments that fit together, states of a gas and a piston."""
