"""Arrays that results hand out."""

import numpy as np

from pneumo_casadi.parameters import FloatArray


def read_only(values: FloatArray) -> FloatArray:
    """Return a read-only copy, so that a result stays what was computed."""
    copy = np.array(values, dtype=float)
    copy.flags.writeable = False
    return copy
