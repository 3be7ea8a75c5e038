"""Parts of commands that import nothing of the command line."""
