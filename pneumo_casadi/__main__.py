"""``python -m pneumo_casadi``."""

from pneumo_casadi.cli import main

main()
