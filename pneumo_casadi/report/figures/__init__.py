"""Figures: one file a family, one style. They need matplotlib, the extra ``plot``."""

from importlib.util import find_spec

from pneumo_casadi.errors import MissingExtraError

if find_spec("matplotlib") is None:
    raise MissingExtraError("figures need matplotlib: pip install 'pneumo-casadi[plot]'")
