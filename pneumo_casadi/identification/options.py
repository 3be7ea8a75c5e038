"""Options of an identification."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from pneumo_casadi.data import Case
from pneumo_casadi.estimation.output_error import OutputErrorOptions
from pneumo_casadi.valve import FlowForm

#: Length of the windows over which a force-driven axis is fitted in open loop [s]. Over a whole
#: record its position would drift with the square of the time.
FORCE_WINDOW = 0.5


@dataclass(frozen=True, slots=True)
class IdentifyOptions:
    """What may be chosen in an identification.

    Parameters
    ----------
    flow_form : FlowForm, optional
        Form of the flow map; by default the one that `choose_flow_form` finds.
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


def output_error_options(case: Case, options: IdentifyOptions) -> OutputErrorOptions:
    """Return the set-up of the output-error fit for a case."""
    chosen = options.output_error or OutputErrorOptions()
    drifts = case.bench.kind.drifts_in_open_loop and not chosen.closed_loop
    if chosen.window is None and drifts:
        return replace(chosen, window=FORCE_WINDOW)
    return chosen
