"""What is known of the valves before any record: where their flow and its scale come from."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from pneumo_casadi.data.bench import quantities
from pneumo_casadi.errors import CaseError

#: Relative accuracy of the conductances of a data sheet that states none: ISO 6358 measurements
#: of several samples of a catalogue type scatter by this much.
DATA_SHEET_ACCURACY = 0.3


class FlowSource(StrEnum):
    """Where the static flow q_m(u, p) of a valve comes from."""

    METERED = "metered"
    """A measured flow map."""
    DATA_SHEET = "data sheet"
    """Sonic conductance C and critical ratio b of the manufacturer (ISO 6358)."""
    NONE = "none"
    """Unknown: the flow is estimated with the axis, its scale comes from the piston areas."""


class Arrangement(StrEnum):
    """How the valves are connected to the chambers."""

    TWO_3_2 = "two 3/2"
    """One three-way valve a chamber."""
    ONE_5_3 = "one 5/3"
    """One five-way valve: chamber P gets the command u, chamber N gets -u."""


ACCURACY = quantities.Quantity("a share of 1", 0.0, 1.0, {"%": (1e-2, 0.0)})
_QUANTITIES = {
    "accuracy": ACCURACY,
    "C_fill": quantities.CONDUCTANCE,
    "C_exhaust": quantities.CONDUCTANCE,
    "b": quantities.Quantity("1", 0.0, 0.95),
    "m": quantities.Quantity("1", 0.1, 2.0),
    "u_full": quantities.Quantity("V", 1e-3, 1e3, {"mV": (1e-3, 0.0)}),
}


@dataclass(frozen=True, slots=True)
class ValveData:
    """What is known of one valve.

    Parameters
    ----------
    source : FlowSource, optional
        Where its flow comes from.
    accuracy : float, optional
        Relative standard uncertainty of the flow scale [1]: of the flow meter for a metered map,
        of C for a data sheet. None where it is not stated.
    C_fill, C_exhaust : float, optional
        Sonic conductance supply to outlet and outlet to exhaust at `u_full` [m³/(s Pa)], needed
        for a data sheet.
    b : float, optional
        Critical pressure ratio [1].
    m : float, optional
        Subsonic index [1].
    u_full : float, optional
        Command at which C was stated [V]; the opening is proportional to u as a first guess.

    Raises
    ------
    CaseError
        If a value is not plausible, or a data sheet has no C.

    Examples
    --------
    >>> valve = ValveData(FlowSource.DATA_SHEET, C_fill=1.2e-8, C_exhaust=1.4e-8, b=0.3, u_full=5.0)
    >>> valve.accuracy
    0.3
    """

    source: FlowSource = FlowSource.METERED
    accuracy: float | None = None
    C_fill: float | None = None
    C_exhaust: float | None = None
    b: float | None = None
    m: float | None = None
    u_full: float | None = None

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "source", FlowSource(self.source))
        except ValueError:
            raise CaseError(
                f"`valve.source`: got {self.source!r}; write "
                f"{' or '.join(repr(str(source)) for source in FlowSource)}"
            ) from None
        for name, quantity in _QUANTITIES.items():
            if getattr(self, name) is not None:
                value = quantity.check(f"valve.{name}", getattr(self, name))
                object.__setattr__(self, name, value)
        if self.accuracy == 0.0 and self.source is FlowSource.DATA_SHEET:
            raise CaseError(
                "`valve.accuracy_percent`: 0 for a data sheet, whose values have tolerances; leave "
                f"it out for {100 * DATA_SHEET_ACCURACY:g} %"
            )
        if self.accuracy == 0.0:  # taken as exact, as where none is stated
            object.__setattr__(self, "accuracy", None)
        if self.source is FlowSource.DATA_SHEET:
            missing = [n for n in ("C_fill", "C_exhaust", "u_full") if getattr(self, n) is None]
            if missing:
                names = ", ".join(f"`valve.{name}`" for name in missing)
                raise CaseError(
                    f"`valve`: no {names} for a data sheet; give the sonic "
                    "conductances and the command at which they hold, or source 'none'"
                )
            if self.accuracy is None:
                object.__setattr__(self, "accuracy", DATA_SHEET_ACCURACY)


class Valves(NamedTuple):
    """What is known of the valve of each chamber."""

    P: ValveData = ValveData()
    N: ValveData = ValveData()

    @property
    def metered(self) -> bool:
        """Whether the flow of both valves was measured."""
        return all(valve.source is FlowSource.METERED for valve in self)
