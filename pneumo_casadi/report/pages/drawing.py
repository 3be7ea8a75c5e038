"""Whether figures can be drawn: matplotlib is an extra."""

import logging
from importlib.util import find_spec

NOT_DRAWN = "no figures: matplotlib is not installed; pip install 'pneumo-casadi[plot]'"

log = logging.getLogger(__name__)


def matplotlib_installed() -> bool:
    """Tell whether matplotlib is installed, without importing it."""
    return find_spec("matplotlib") is not None


def can_draw() -> bool:
    """Tell whether figures can be drawn; if not, log the remedy."""
    if matplotlib_installed():
        return True
    log.warning(NOT_DRAWN)
    return False
