"""Curves for the figures of a diagnosis: simulations, unknown inputs, regime maps."""

from dataclasses import dataclass

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.diagnosis.locate.regime_maps import RegimeMap, map_regimes
from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel
from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.runtime.presentation import Brief


@dataclass(frozen=True, eq=False, repr=False)
class Evidence(Brief):
    """Curves behind a diagnosis.

    Parameters
    ----------
    inputs : tuple of UnknownInputs
        Of the axis without effects, one a held-out record.
    before, after : tuple of RegimeMap
        Residuals of the balances over operating conditions, without effects and with those found;
        `after` is empty where none was found.
    simulations : tuple of Curves
        Outputs of the held-out records, measured and simulated; see `simulated_curves`.
    """

    inputs: tuple[UnknownInputs, ...]
    before: tuple[RegimeMap, ...]
    after: tuple[RegimeMap, ...] = ()
    simulations: tuple[Curves, ...] = ()


def collect_evidence(
    study: Study,
    inputs: tuple[UnknownInputs, ...],
    nominal: FittedModel,
    final: FittedModel | None = None,
    simulations: tuple[Curves, ...] = (),
) -> Evidence:
    """Return the curves behind a diagnosis.

    Parameters
    ----------
    study : Study
        Records and nominal axis.
    inputs : tuple of UnknownInputs
        From `estimate_unknown_inputs`.
    nominal : FittedModel
        The fit without effects.
    final : FittedModel, optional
        The fit with the effects found.
    simulations : tuple of Curves, optional
        From `simulated_curves`.
    """
    after = () if final is None else map_regimes(study, final)
    return Evidence(inputs, map_regimes(study, nominal), after, simulations)
