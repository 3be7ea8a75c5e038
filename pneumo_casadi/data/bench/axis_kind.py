"""The kinds of axis: states, inputs, outputs, balances and junctions of each, defined once.

Everything that depends on the kind of an axis asks its `AxisKind` (``bench.kind``,
``axis.kind``). A further kind is one entry here, its balances in `model/balances.py` and its
keys in `bench_file.py`.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Balance:
    """One balance of eq. 1; it determines the rate of one state.

    Parameters
    ----------
    name : str
        In results: ``mass_flow_P``, ``mass_flow_N`` or ``force``.
    unit : str
        SI unit of its residual.
    state : str
        State whose rate it determines.
    chamber : str, optional
        Chamber whose mass it balances; empty for the force balance.
    over_inertia : bool, optional
        Whether an equation-error fit divides the residual by the nominal factor of the rate. This
        is necessary where a common scale of all terms is free, because a smaller scale would
        shrink the residual.
    equation_error_unit : str, optional
        Unit of the residual in an equation-error fit; by default `unit`.
    resolution : float, optional
        Residuals of an equation-error fit below this count as zero [equation_error_unit].
    """

    name: str
    unit: str
    state: str
    chamber: str = ""
    over_inertia: bool = False
    equation_error_unit: str = ""
    resolution: float = 0.0

    def __post_init__(self) -> None:
        if not self.equation_error_unit:
            object.__setattr__(self, "equation_error_unit", self.unit)


@dataclass(frozen=True, slots=True)
class AxisKind:
    """What an axis of this kind has.

    Parameters
    ----------
    name : str
        Value of ``"axis"`` in ``bench.json``.
    title : str
        What messages call it.
    states, inputs, outputs : tuple of str
        Symbols of the nominal axis, in order; units and sizes are in `UNITS` and `SCALES`.
    balances : tuple of Balance
        In the order of the residuals.
    junctions : frozenset of str
        Junctions at which effects may act.
    chambers : tuple of str, optional
        Chambers whose pressure is known, be it a state or an input.
    constants : tuple of str, optional
        Attributes of the bench that the model uses; one that is None is left out.
    measured_inputs : bool, optional
        Whether the inputs are measured signals; otherwise they are commands, known exactly.
    further : mapping of str to str, optional
        Signals that a laboratory may record besides -> ``"input"`` or ``"output"``; see
        `with_signals`.

    Examples
    --------
    >>> PNEUMATIC.gas_chambers, FORCE_DRIVEN.gas_chambers
    (('P', 'N'), ())
    >>> [balance.name for balance in FORCE_DRIVEN.balances]
    ['force']
    """

    name: str
    title: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    balances: tuple[Balance, ...]
    junctions: frozenset[str]
    chambers: tuple[str, ...] = ()
    constants: tuple[str, ...] = ()
    measured_inputs: bool = False
    further: Mapping[str, str] = field(default_factory=dict, hash=False, compare=False)

    def with_signals(self, signals: Collection[str]) -> "AxisKind":
        """Return the kind with further recorded signals as inputs and outputs.

        Parameters
        ----------
        signals : collection of str
            Among `further`: a supply pressure ``p_supply`` [Pa] or a force on the rod ``F_load``
            [N] is an input, a velocity ``v`` [m/s] or an acceleration ``a`` [m/s²] an output.

        Examples
        --------
        >>> PNEUMATIC.with_signals(["p_supply", "v"]).inputs
        ('u_P', 'u_N', 'p_supply')
        """
        return _with_signals(self, frozenset(signals)) if signals else self

    @property
    def commands(self) -> tuple[str, ...]:
        """Inputs of the nominal axis, which a controller sets; further inputs come after them."""
        return tuple(name for name in self.inputs if self.further.get(name) != "input")

    @property
    def gas_chambers(self) -> tuple[str, ...]:
        """Chambers whose mass flow is balanced, so that their pressures are states."""
        return tuple(balance.chamber for balance in self.balances if balance.chamber)

    @property
    def needs_flow_map(self) -> bool:
        """Whether the model needs the static flow of the valves (eq. 12)."""
        return bool(self.gas_chambers)

    @property
    def drifts_in_open_loop(self) -> bool:
        """Whether the position is no more than the double integral of the inputs."""
        return not self.gas_chambers


@cache
def _with_signals(kind: AxisKind, signals: frozenset[str]) -> AxisKind:
    chosen = [name for name in kind.further if name in signals]
    inputs = [name for name in chosen if kind.further[name] == "input"]
    outputs = [name for name in chosen if kind.further[name] == "output"]
    return replace(kind, inputs=(*kind.inputs, *inputs), outputs=(*kind.outputs, *outputs))


#: SI units of states, inputs and outputs of the nominal axes.
UNITS = {
    "p_P": "Pa",
    "p_N": "Pa",
    "x": "m",
    "v": "m/s",
    "a": "m/s2",
    "u_P": "V",
    "u_N": "V",
    "F": "N",
    "p_supply": "Pa",
    "F_load": "N",
}
#: Sizes by which an optimiser divides states [SI].
SCALES = {"p_P": 1e5, "p_N": 1e5, "x": 0.1, "v": 0.5}

_MOTION_SENSORS = {"v": "output", "a": "output", "F_load": "input"}

#: The servo axis of eq. 1-4: two valves, two chambers and a mass.
PNEUMATIC = AxisKind(
    name="pneumatic",
    title="servo axis",
    states=("p_P", "p_N", "x", "v"),
    inputs=("u_P", "u_N"),
    outputs=("p_P", "p_N", "x"),
    balances=(
        Balance("mass_flow_P", "kg/s", "p_P", "P", True, "Pa/s", 10.0),
        Balance("mass_flow_N", "kg/s", "p_N", "N", True, "Pa/s", 10.0),
        Balance("force", "N", "v", resolution=1e-3),
    ),
    junctions=frozenset(
        {
            "chamber_pressure",
            "command",
            "spool",
            "supply",
            "outlet",
            "valve_flow",
            "line",
            "chamber_flow",
            "chamber_energy",
            "capacity",
            "force",
            "output",
        }
    ),
    chambers=("P", "N"),
    constants=("S_P", "S_N", "p_ext", "p_supply", "T", "r", "stroke"),
    further=MappingProxyType({"p_supply": "input", **_MOTION_SENSORS}),
)

#: A mass that a known force drives.
FORCE_DRIVEN = AxisKind(
    name="force",
    title="force-driven axis",
    states=("x", "v"),
    inputs=("F",),
    outputs=("x",),
    balances=(Balance("force", "N", "v", "", True, "m/s2", 1e-5),),
    junctions=frozenset({"drive", "force", "output"}),
    constants=("stroke",),
    measured_inputs=True,
    further=MappingProxyType(_MOTION_SENSORS),
)

PRESSURE_DRIVEN = AxisKind(
    name="pressures",
    title="pressure-driven axis",
    states=("x", "v"),
    inputs=("p_P", "p_N"),
    outputs=("x",),
    balances=(Balance("force", "N", "v", resolution=1e-3),),
    junctions=frozenset({"drive", "force", "output"}),
    chambers=("P", "N"),
    constants=("p_ext", "stroke"),
    measured_inputs=True,
    further=MappingProxyType(_MOTION_SENSORS),
)

#: The same with one chamber; the other one is open to the ambient pressure.
SINGLE_ACTING = replace(PRESSURE_DRIVEN, inputs=("p_P",), chambers=("P",))

KINDS = (PNEUMATIC, FORCE_DRIVEN, PRESSURE_DRIVEN)
#: Outputs and inputs of all kinds: the channels that a recording of an unknown axis may have.
OUTPUTS = tuple(dict.fromkeys(n for kind in KINDS for n in kind.with_signals(kind.further).outputs))
INPUTS = tuple(dict.fromkeys(n for kind in KINDS for n in kind.with_signals(kind.further).inputs))
#: Inputs that are measured beside the commands, by whatever axis.
MEASURED_INPUTS = tuple(n for n in INPUTS if any(k.further.get(n) == "input" for k in KINDS))
