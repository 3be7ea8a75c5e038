"""Absorption: which parameters take up an effect that the fitted model lacks."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

#: Checks of fitted parameters against geometry and data sheet, the most specific first: effects
#: that may be absorbed are named in the order of the first check that they fail.
PARAMETER_CHECKS = (
    "S_N/S_P",
    "F_c",
    "map form",
    "S_P",
    "S_N",
    "k_P",
    "k_N",
    "k_P-k_N",
    "V_P(0)",
    "V_N(0)",
    "M",
    "flow map",
    "flow scale",
)


class Deviation(Enum):
    """On which side of its expected value a parameter must lie."""

    ABOVE = "above"
    BELOW = "below"
    EITHER = "either"


@dataclass(frozen=True, slots=True)
class Absorption:
    """Which checks fail if a refit of the nominal parameters absorbs an effect.

    Parameters
    ----------
    checks : tuple of str
        Of `PARAMETER_CHECKS`: at least one of them fails.
    deviation : Deviation, optional
        On which side of the expected value.
    also : tuple of str, optional
        At least one of these fails too; no condition if empty.
    unless : tuple of str, optional
        None of these fails.

    Examples
    --------
    >>> leak = Absorption(("S_N/S_P",), Deviation.ABOVE, also=("k_N", "V_N(0)"))
    >>> leak.first_failed({"S_N/S_P": True, "k_N": False})
    'S_N/S_P'
    >>> leak.first_failed({"S_N/S_P": True}) is None
    True
    """

    checks: tuple[str, ...]
    deviation: Deviation = Deviation.EITHER
    also: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All checks that it refers to."""
        return (*self.checks, *self.also, *self.unless)

    def first_failed(self, failed: Mapping[str, bool]) -> str | None:
        """Return the check by which the effect shows; None where it does not.

        Parameters
        ----------
        failed : mapping of str to bool
            Checks that fail, and whether the value is above the expected one.
        """
        if self.also and not any(name in failed for name in self.also):
            return None
        if any(name in failed for name in self.unless):
            return None
        shown = (name for name in self.checks if name in failed and self._deviates(failed[name]))
        return next(shown, None)

    def _deviates(self, above: bool) -> bool:
        return self.deviation is Deviation.EITHER or above is (self.deviation is Deviation.ABOVE)
