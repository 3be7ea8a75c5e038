"""What a diagnosis returns, as objects, plain data and files."""
