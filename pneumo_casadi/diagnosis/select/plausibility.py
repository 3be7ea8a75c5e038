"""A further effect that is small beside the gap of the first, but mends what no axis can have."""

import numpy as np

from pneumo_casadi.diagnosis.checks.parameter_checks import checks_of
from pneumo_casadi.diagnosis.metrics.residual_size import size
from pneumo_casadi.diagnosis.prepare.study import Fitted
from pneumo_casadi.diagnosis.select.acceptance import MATTERS
from pneumo_casadi.diagnosis.select.fit_ledger import Names, Searcher

#: What an axis is known by; other checks have causes of their own.
KNOWN_BY = {"S_P": "areas", "S_N": "areas", "S_N/S_P": "areas", "F_c": "friction", "M": "mass"}
#: So many of these must be wrong: one alone may come from what the form of an effect misses.
WRONG = 2
#: Log-likelihood that an effect must gain beside what its mending says for it.
GAIN = 100.0


def mended(worker: Searcher, current: Fitted, known: Names) -> Names | None:
    """Return a model with one more effect with which all parameters are possible, or None.

    What the form of a large effect misses is no second cause, so a further one is asked to close
    a share of the first gap (`accepted`). Where friction that pushes along the motion and pistons
    that the bench has not come out with the first effect, and one more puts all of them right,
    that tells more than the size of the gap.

    Parameters
    ----------
    current : Fitted
        The best model so far, with the effects `known`.
    """
    if not known or len(_wrong(worker, known, current)) < WRONG:
        return None
    better = {
        key: fitted
        for key, fitted in worker.extensions(known).items()
        if fitted.cost < current.cost - GAIN
        and np.any(np.log(size(current) / size(fitted)) > MATTERS)
    }
    for key in sorted(better, key=lambda key: better[key].cost):
        if not _wrong(worker, key, better[key]):
            return key
    return None


def _wrong(worker: Searcher, names: Names, fitted: Fitted) -> set[str]:
    checks = checks_of(worker.study, fitted, worker.effects(names))
    return {KNOWN_BY[one.name] for one in checks if one.name in KNOWN_BY and not one.agrees}
