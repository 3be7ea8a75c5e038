"""Selection of effects, forward from the nominal model."""
