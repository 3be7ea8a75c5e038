"""The bench: geometry, constants, controllers, plausible quantities, and its file."""
