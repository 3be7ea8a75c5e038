"""Options of an identification."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from numbers import Real
from typing import Any

from pneumo_casadi.data import Case
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.valve import FlowForm
from pneumo_casadi.valve.polynomials import check_degrees

#: Length of the windows over which a force-driven axis is fitted in open loop [s]. Over a whole
#: record its position would drift with the square of the time.
FORCE_WINDOW = 0.5


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """What may be chosen in an identification.

    Parameters
    ----------
    flow_form : FlowForm or str, optional
        Form of the flow map, as ``FlowForm.ISO6358`` or ``"iso6358"``; by default the one that
        `choose_flow_form` finds.
    degrees : tuple of int, optional
        Degrees of the polynomials in the outlet pressure p in eq. 12 of the paper,
        q_m(u, p) = φ(p) + ψ(p, sign u) u: of the leakage φ, and of the flow gain ψ for u > 0 and
        for u < 0. If `flow_form` is ``FlowForm.POLYNOMIALS``, the default is (7, 7, 4), as in the
        paper; if `flow_form` is not given either, cross-validation chooses them.
    refine_flow : bool
        Whether the coefficients of the flow map are refined together with the parameters,
        anchored by its measured points.
    start, end : float, optional
        Part of each record to identify on [s, on its own clock]; by default all of it.
    output_error : OutputErrorOptions, optional
        Set-up of the output-error fit; by default whole records, or windows of 0.5 s for a
        force-driven axis in open loop.
    windows : tuple of float
        Lengths of the validation windows [s].
    identifiability : bool
        Whether to analyse which data inform each parameter, and which parameters are collinear.
    effects : tuple of str
        Effects of the catalogue (`EFFECTS`) to add to the nominal axis. Output error estimates
        all of them, weighted least squares those whose parameters enter linearly.
    fixed : mapping of str to float
        Parameters to hold at a value [SI], as ``{"M": 16.4, "stribeck.v_stribeck": 0.02}``.
    start_values : mapping of str to float
        Values at which output error starts [SI]; by default those of weighted least squares, and
        for effects that it does not see those of the catalogue. The polytropic exponents can be
        given too: ``k_P`` sets X_s2 and X_s1 from X_s3, ``k_N`` sets X_s5 and X_s4 from X_s6. A
        parameter that an effect holds by default is estimated if it is listed here.
    each_record : bool
        Whether each of several records is also fitted alone, flow map held, to set the spread of
        the estimates beside their intervals.

    Raises
    ------
    ModelError
        If a form is unknown, degrees, lengths or values are no numbers that can be used, or names
        are not in a sequence.

    Examples
    --------
    Eq. 12 with the degrees of the paper, on ten seconds of each record:

    >>> options = IdentifyOptions(FlowForm.POLYNOMIALS, degrees=(7, 7, 4), start=5.0, end=15.0)
    >>> options.refine_flow, options.windows
    (True, (0.1, 0.5, 2.0))

    With friction after Stribeck, the mass held and another start of k_P:

    >>> options = IdentifyOptions(
    ...     effects=("stribeck",), fixed={"M": 16.4}, start_values={"k_P": 1.2}
    ... )
    """

    flow_form: FlowForm | None = None
    degrees: tuple[int, int, int] | None = None
    refine_flow: bool = True
    start: float | None = None
    end: float | None = None
    output_error: OutputErrorOptions | None = None
    windows: tuple[float, ...] = (0.1, 0.5, 2.0)
    identifiability: bool = False
    effects: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    start_values: Mapping[str, float] = field(default_factory=dict)
    each_record: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "flow_form", flow_form_of(self.flow_form))
        if self.degrees is not None:
            check_degrees(self.degrees)
            object.__setattr__(self, "degrees", tuple(map(int, self.degrees)))
        for name, kind in (
            ("windows", "lengths [s], as (0.5,)"),
            ("effects", 'names, as ("hose",)'),
        ):
            values: Any = getattr(self, name)
            if isinstance(values, str) or not hasattr(values, "__iter__"):
                raise ModelError(f"{name}: {values!r}; give a sequence of {kind}")
            object.__setattr__(self, name, tuple(values))
        for window in self.windows:
            if not (_is_finite(window) and window > 0):
                raise ModelError(f"windows: {window!r} s; give positive lengths in seconds")
        object.__setattr__(self, "windows", tuple(map(float, self.windows)))
        for name in ("start", "end"):
            time = getattr(self, name)
            if time is not None and not _is_finite(time):
                raise ModelError(f"{name}: {time!r} s; give a time in seconds")
        for name in ("fixed", "start_values"):
            _check_values(name, getattr(self, name))
        if not isinstance(self.output_error, OutputErrorOptions | None):
            raise ModelError(f"output_error: {self.output_error!r}; give OutputErrorOptions")


def flow_form_of(form: FlowForm | str | None) -> FlowForm | None:
    """Return the form of a flow map that is given itself, by its name or not at all.

    Raises
    ------
    ModelError
        If no form has the name; the message lists all.

    Examples
    --------
    >>> flow_form_of("iso6358") is FlowForm.ISO6358
    True
    """
    try:
        return None if form is None else FlowForm(form)
    except ValueError:
        known = ", ".join(item.value for item in FlowForm)
        raise ModelError(f"flow_form: no form {form!r}; there are {known}") from None


def _is_finite(value: object) -> bool:
    return isinstance(value, Real) and isfinite(value)


def _check_values(name: str, values: object) -> None:
    """Refuse values of parameters that are no numbers by name."""
    example = 'give numbers by name [SI], as {"M": 16.4}'
    if not isinstance(values, Mapping):
        raise ModelError(f"{name}: {values!r}; {example}")
    for parameter, value in values.items():
        if not _is_finite(value):
            raise ModelError(f"{name}: {parameter} = {value!r}; {example}")


def output_error_options(case: Case, options: IdentifyOptions) -> OutputErrorOptions:
    """Return the set-up of the output-error fit for a case."""
    chosen = options.output_error or OutputErrorOptions()
    drifts = case.bench.kind.drifts_in_open_loop and not chosen.closed_loop
    if chosen.window is None and drifts:
        return replace(chosen, window=FORCE_WINDOW)
    return chosen
