"""What figures of a diagnosis show beside its numbers: unknown inputs over time, regime maps."""

from dataclasses import dataclass

from pneumo_casadi.diagnosis.locate.regimes import RegimeMap, maps_of
from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs
from pneumo_casadi.diagnosis.prepare.study import Fitted, Study


@dataclass(frozen=True, eq=False)
class Evidence:
    """Curves behind a diagnosis.

    Parameters
    ----------
    inputs : tuple of UnknownInputs
        Of the axis without effects, one a held-out record.
    before, after : tuple of RegimeMap
        Residuals of the balances over what went on, without effects and with those found;
        `after` is empty where none was found.
    """

    inputs: tuple[UnknownInputs, ...]
    before: tuple[RegimeMap, ...]
    after: tuple[RegimeMap, ...] = ()


def evidence_of(
    one: Study,
    inputs: tuple[UnknownInputs, ...],
    nominal: Fitted,
    final: Fitted | None = None,
) -> Evidence:
    """Return the curves behind a diagnosis.

    Parameters
    ----------
    one : Study
        Records and nominal axis.
    inputs : tuple of UnknownInputs
        From `inputs_of`.
    nominal : Fitted
        The fit without effects.
    final : Fitted, optional
        The fit with the effects found.
    """
    after = () if final is None else maps_of(one, final)
    return Evidence(inputs, maps_of(one, nominal), after)
