"""``python -m pneumo_casadi``."""

from pneumo_casadi.cli.app import main

main()
