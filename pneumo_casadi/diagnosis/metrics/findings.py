"""What a diagnosis is made of: candidates, locations, gaps and checks, each with its figures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pneumo_casadi.diagnosis.metrics.location import Location
from pneumo_casadi.diagnosis.metrics.regime import Regime
from pneumo_casadi.model.junctions import Junction

#: What stands between the names of effects that act together.
_BOTH = " + "


def joined_names(names: Sequence[str]) -> str:
    """Return the names of effects that act together as one label of a JSON result or a table.

    Examples
    --------
    >>> joined_names(("stribeck", "hose"))
    'stribeck + hose'
    """
    return _BOTH.join(names)


def split_names(label: str) -> tuple[str, ...]:
    """Return the names of effects from their label, as `joined_names` wrote it.

    Examples
    --------
    >>> split_names("stribeck + hose")
    ('stribeck', 'hose')
    """
    return tuple(label.split(_BOTH)) if label else ()


@dataclass(frozen=True, slots=True)
class Value:
    """A quantity with its standard deviation, in `unit`.

    Parameters
    ----------
    value, std : float
        Estimate and standard deviation, in `unit`; 0 where it was held.
    unit : str
        SI unit.
    at_bound : bool, optional
        Whether the estimate ends at a bound: its interval is one-sided.
    """

    value: float
    std: float
    unit: str
    at_bound: bool = False


@dataclass(frozen=True, slots=True)
class Closure:
    """How far a gap closes: 1 - after/before, with an interval from a block bootstrap.

    Parameters
    ----------
    value : float
        Share of the gap that closes [1]; negative where it grows.
    lower, upper : float
        Ends of the 95 % interval [1].
    """

    value: float
    lower: float
    upper: float


@dataclass(frozen=True, slots=True)
class EffectFound:
    """An effect that was added to the model.

    Parameters
    ----------
    name : str
        The cause, by its name in the catalogue.
    probability : float
        That it is part of the cause.
    parameters : mapping of str to Value
        Its own parameters as fitted, by their short names.
    contribution : float, optional
        Share of the held-out gap that comes back without it.
    form : str, optional
        Effect of the catalogue that was added, one of the forms of this cause; by default the one
        that has its name.
    forms : mapping of str to float, optional
        Share of the held-out gap that each form closes alone; empty for a cause of one form.
    rivals : mapping of str to float, optional
        Other causes that do nearly as well in its place, with their probabilities.
    """

    name: str
    probability: float
    parameters: Mapping[str, Value]
    contribution: float = 0.0
    form: str = ""
    forms: Mapping[str, float] = field(default_factory=dict)
    rivals: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "form", self.form or self.name)


@dataclass(frozen=True, slots=True)
class Candidate:
    """One line of the ranking: an effect, or several together.

    Parameters
    ----------
    names : tuple of str
        Effects of the model.
    probability : float
        That these and no others are the cause.
    closure : Closure or None
        Of the held-out gap in the balances; None where the fit failed.
    explained : float
        Share of the squared residuals that the screen promises, 0 to 1.
    observable : float
        Share of the effect's influence that no refit of the nominal model takes up, 0 to 1.
    parameters : mapping of str to Value
        As fitted.
    failure : str
        Why there is no fit; empty where there is one.
    """

    names: tuple[str, ...]
    probability: float
    closure: Closure | None
    explained: float
    observable: float
    parameters: Mapping[str, Value] = field(default_factory=dict)
    failure: str = ""

    @property
    def label(self) -> str:
        """The names as JSON results and tables show them."""
        return joined_names(self.names)


@dataclass(frozen=True, slots=True)
class SensorError:
    """A sensor error that could explain the residuals.

    Parameters
    ----------
    sensor : str
        ``"position"`` or ``"pressures"``.
    explained : float
        Share of all squared residuals that an error of this sensor alone explains [1].
    """

    sensor: str
    explained: float


@dataclass(frozen=True, slots=True)
class Where:
    """Where simulation and measurement disagree.

    Parameters
    ----------
    balance : Location
        In which balance, or in what the sensors show.
    junction : Junction or None
        Of the effect found, or that which the regimes point to.
    regimes : tuple of Regime
        The most telling ones, the strongest first.
    shares : mapping of str to float
        Energy of the unknown input in each balance, in units of its noise floor, as shares.
    rivals : tuple of str
        Sensor effects that could look the same.
    unknown_inputs : mapping of str to float, optional
        Unknown input of each balance over the balance's own signal, root mean squares [1].
    sensor_error : SensorError or None, optional
        The best hypothesis about sensors; None unless the balance is ``measurement``.
    effects : tuple of str, optional
        Causes of the verdict that act at the junction.
    balances : tuple of Location, optional
        All places of the answer, that of `balance` among them: both mass flows where both chambers
        are affected, and those of further effects. By default `balance` alone.
    sizes : mapping of str to mapping of str to float, optional
        What each effect found adds to each balance, over the balance's own signal, root mean
        squares [1]: by cause, then by balance. An effect in a sensor adds to none.
    in_parameters : bool, optional
        Whether simulation and measurement agree, and only parameters of the balance contradict
        geometry or data sheet.
    """

    balance: Location
    junction: Junction | None
    regimes: tuple[Regime, ...]
    shares: Mapping[str, float]
    rivals: tuple[str, ...]
    unknown_inputs: Mapping[str, float] = field(default_factory=dict)
    sensor_error: SensorError | None = None
    effects: tuple[str, ...] = ()
    balances: tuple[Location, ...] = ()
    sizes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    in_parameters: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "balances", self.balances or (self.balance,))


@dataclass(frozen=True, slots=True)
class Gap:
    """The held-out gap, before and after, in per cent of the signals.

    Parameters
    ----------
    before, after : float
        Root mean square over the outputs of what lies above the noise floor, open loop in
        windows of half a second.
    noise_floor : float
        What the sensors' noise alone leaves.
    closure : Closure
        Of this gap.
    views : mapping of str to mapping of str to mapping of str to float
        The same by view (``windows``, ``closed_loop``, ``balances``) and output or balance:
        ``before``, ``after``, ``noise``; ``with_term`` besides where it was
        simulated.
    with_term : float, optional
        As `after`, with a discovered term in the model; None where there is none to simulate.
    """

    before: float
    after: float
    noise_floor: float
    closure: Closure
    views: Mapping[str, Mapping[str, Mapping[str, float]]]
    with_term: float | None = None


@dataclass(frozen=True, slots=True)
class Check:
    """A parameter held against geometry or data sheet.

    Parameters
    ----------
    name : str
        ``S_P``, ``S_N``, ``k_P``, ``k_N``, ``M``, ``flow map`` ...
    value, std, expected, tolerance : float
        Found, and what it should be within, in `unit`.
    unit : str
        SI unit.
    agrees : bool
        Whether it does.
    text : str
        In words.
    decisive : bool, optional
        Whether agreement says anything: not where the range excludes gross errors only, or the
        estimate is so uncertain that hardly any value would contradict.
    """

    name: str
    value: float
    std: float
    expected: float
    tolerance: float
    unit: str
    agrees: bool
    text: str
    decisive: bool = True
