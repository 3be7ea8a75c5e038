"""Choice of the form of the flow map by held-out error."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any

import numpy as np

from pneumo_casadi.errors import CaseError, FitError, PneumoError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.valve.choice.degree_selection import Folds, fold_masks, select_degrees
from pneumo_casadi.valve.flow_map import FlowMap
from pneumo_casadi.valve.flow_model import FlowModel
from pneumo_casadi.valve.iso6358_fit import fit_iso6358, fit_iso6358_curve
from pneumo_casadi.valve.orifice import T_ANR
from pneumo_casadi.valve.polynomial_fit import solve_polynomials
from pneumo_casadi.valve.polynomials import Degrees
from pneumo_casadi.valve.spline import smooth_map

#: Degrees of (φ, ψ⁺, ψ⁻) in the paper.
PAPER_DEGREES: Degrees = (7, 7, 4)
#: Folds of the cross-validation where the map has pressures enough.
FOLDS = 5
#: What a curve must leave at most of the hyperbola's residual to be compared: 1 % is chance.
CLOSER = 0.99

Fit = Callable[[FlowMap], FlowModel]
logger = logging.getLogger(__name__)


class FlowForm(Enum):
    """How the static flow map is written; where several do equally well, the first is taken."""

    POLYNOMIALS = "polynomials"
    """Eq. 12 of the paper."""
    ISO6358 = "iso6358"
    """Two metering edges of ISO 6358."""
    ISO6358_CURVE = "iso6358_curve"
    """Two metering edges of ISO 6358, each opening along a curve of five slopes."""
    SPLINE = "spline"
    """Smoothing spline; only its gain is refined by the output-error fit."""


#: Fits of the forms whose flow is that of ISO 6358.
ISO6358_FITS = {
    FlowForm.ISO6358: fit_iso6358,
    FlowForm.ISO6358_CURVE: fit_iso6358_curve,
}


class Reason(Enum):
    """Why a form was chosen."""

    LEAST_ERROR = "least held-out error"
    EQUALLY_WELL = "preferred among forms within one standard error of the least held-out error"
    ONLY_FORM = "the only form that the map determines"
    TOO_FEW_POINTS = "too few metered points for a comparison"
    GIVEN = "given by hand"


@dataclass(frozen=True, slots=True)
class FormError:
    """Held-out error of one form.

    Parameters
    ----------
    form : FlowForm
        The form.
    degrees : tuple of int or None
        Degrees of (φ, ψ⁺, ψ⁻), for polynomials.
    percent : float or None
        Root of the mean square error on withheld points, per cent of the largest flow; None where
        the form was not compared.
    standard_error : float or None
        Standard error of `percent` over the folds.
    failure : str
        Why the form was not compared; empty where it was.
    """

    form: FlowForm
    degrees: Degrees | None = None
    percent: float | None = None
    standard_error: float | None = None
    failure: str = ""


@dataclass(frozen=True, slots=True)
class FormSelection:
    """Forms of the flow map compared on withheld points, and the one chosen.

    Parameters
    ----------
    chosen : FlowForm
        Form to be used.
    reason : Reason
        Why it was chosen.
    candidates : tuple of FormError
        All forms compared, in the order of preference; the form itself where it was given.
    folds : int
        Number of folds; 0 where no comparison was possible.
    """

    chosen: FlowForm
    reason: Reason
    candidates: tuple[FormError, ...]
    folds: int

    @property
    def degrees(self) -> Degrees | None:
        """Degrees of (φ, ψ⁺, ψ⁻) if polynomials were chosen."""
        return self.error_of(self.chosen).degrees

    @property
    def best(self) -> FlowForm | None:
        """Form with the least held-out error; None where no comparison was possible."""
        compared = {e.form: e.percent for e in self.candidates if e.percent is not None}
        return min(compared, key=compared.__getitem__) if compared else None

    @classmethod
    def given(cls, form: FlowForm, degrees: Degrees | None = None) -> "FormSelection":
        """Return the selection of a form that was given by hand: nothing is compared."""
        shown = (degrees or PAPER_DEGREES) if form is FlowForm.POLYNOMIALS else None
        return cls(form, Reason.GIVEN, (FormError(form, shown),), 0)

    def error_of(self, form: FlowForm) -> FormError:
        """Return the held-out error of a form."""
        return next(error for error in self.candidates if error.form is form)

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values."""
        return {
            "chosen": self.chosen.value,
            "reason": self.reason.name.lower(),
            "folds": self.folds,
            "candidates": [
                {
                    "form": error.form.value,
                    "degrees": None if error.degrees is None else list(error.degrees),
                    "held_out_percent": error.percent,
                    "standard_error_percent": error.standard_error,
                    "failure": error.failure or None,
                }
                for error in self.candidates
            ],
        }


def choose_flow_form(
    table: FlowMap, *, T: float = T_ANR, degrees: Degrees | None = None, folds: int = FOLDS
) -> FormSelection:
    """Choose the form of a flow map by the error on withheld points of the map.

    Parameters
    ----------
    table : FlowMap
        Measured points.
    T : float, optional
        Temperature upstream of the valve [K], for ISO 6358.
    degrees : tuple of int, optional
        Degrees of (φ, ψ⁺, ψ⁻); by default chosen by `select_degrees`.
    folds : int, optional
        Number of folds K; fewer where the map has fewer pressures.

    Returns
    -------
    FormSelection

    Raises
    ------
    CaseError
        If no form can be fitted to the map, or no polynomials of the `degrees` given.

    Notes
    -----
    The folds are those of `select_degrees`: whole pressure columns and whole command rows are
    withheld together, so that the error is one of interpolation. Points withheld at random would
    have neighbours at their own pressure and command, and every flexible form would look good.

    The one-standard-error rule [1]_ decides: of all forms whose mean square error is at most the
    least one plus the standard error of that, the first in the order polynomials (eq. 12),
    ISO 6358, ISO 6358 with curved openings, spline is chosen. The spline comes last because output
    error can refine its gain alone: what its shape misses stays in X_s.

    Curved openings are compared where they come closer to the whole map than hyperbolas do.

    Where the map has too few pressures for two folds, nothing is compared and the form with the
    fewest free coefficients, ISO 6358, is taken if it can be fitted.

    References
    ----------
    .. [1] T. Hastie, R. Tibshirani, J. Friedman, *The Elements of Statistical Learning*,
       2nd ed., section 7.10.

    Examples
    --------
    >>> u, p = (a.ravel() for a in np.meshgrid(np.linspace(-3, 3, 13), np.linspace(1e5, 7e5, 13)))
    >>> q_m = 1e-9 * (4e5 - p) + np.where(u > 0, 2e-3 * (7e5 - p), 1e-3 * (p - 1e5)) * u / 6e5
    >>> q_m += 1e-6 * np.random.default_rng(0).standard_normal(q_m.size)
    >>> selection = choose_flow_form(FlowMap(u, p, q_m, p_supply=7e5, p_ext=1e5))
    >>> selection.chosen.value, selection.degrees, selection.reason.name
    ('polynomials', (1, 1, 1), 'EQUALLY_WELL')
    """
    compared: dict[FlowForm, FormError] = {}
    squares: dict[FlowForm, FloatArray] = {}
    folds, masks = _masks(table, folds)
    for form in FlowForm:
        shown = None
        try:
            if form is FlowForm.POLYNOMIALS:
                shown = degrees or (
                    select_degrees(table, folds=folds).chosen if masks else PAPER_DEGREES
                )
            fit = _fit_of(form, table, T, shown or PAPER_DEGREES)
            squares[form] = np.array(
                [
                    np.mean(fit(table.select(train)).residuals(table.select(test)) ** 2)
                    for train, test in masks
                ]
            )
        except PneumoError as error:
            if form is FlowForm.POLYNOMIALS and degrees is not None:
                raise _refused(table, degrees, error) from None
            compared[form] = FormError(form, shown, failure=str(error))
            continue
        compared[form] = _summarised(form, shown, squares[form], table.q_max)
    if not squares:
        failures = "; ".join(error.failure for error in compared.values())
        raise CaseError(f"{table.source}: no form can be fitted to the map: {failures}")
    chosen, reason = _choose(squares)
    logger.info("flow map as %s: %s", chosen.value, reason.value)
    return FormSelection(chosen, reason, tuple(compared.values()), folds)


def _refused(table: FlowMap, degrees: Degrees, error: PneumoError) -> CaseError:
    """Return why polynomials of given degrees are not compared: for the map, or for its parts."""
    try:
        solve_polynomials(table, degrees)
    except PneumoError as whole:
        return CaseError(f"degrees {degrees}: {whole}")
    return CaseError(
        f"degrees {degrees}: the whole map bears them, what is left of it to compare forms on "
        f"withheld points does not ({error}); lower them, or choose the form as well: "
        "--flow polynomials, flow_form=FlowForm.POLYNOMIALS"
    )


def _masks(table: FlowMap, folds: int) -> tuple[int, Folds]:
    """Return the largest possible number of folds up to that asked for, and the folds."""
    for n in range(folds, 1, -1):
        try:
            return n, fold_masks(table, n)
        except CaseError:
            continue
    return 0, []


def _choose(squares: dict[FlowForm, FloatArray]) -> tuple[FlowForm, Reason]:
    if len(squares) == 1:
        return next(iter(squares)), Reason.ONLY_FORM
    if not any(errors.size for errors in squares.values()):
        fewest = FlowForm.ISO6358 if FlowForm.ISO6358 in squares else next(iter(squares))
        return fewest, Reason.TOO_FEW_POINTS
    mean = {form: float(errors.mean()) for form, errors in squares.items()}
    best = min(mean, key=mean.__getitem__)
    limit = mean[best] + _standard_error(squares[best])
    chosen = next(form for form in FlowForm if form in mean and mean[form] <= limit)
    return chosen, Reason.LEAST_ERROR if chosen is best else Reason.EQUALLY_WELL


def _summarised(
    form: FlowForm, degrees: Degrees | None, errors: FloatArray, q_max: float
) -> FormError:
    if not errors.size:
        return FormError(form, degrees, failure=Reason.TOO_FEW_POINTS.value)
    rms = float(np.sqrt(errors.mean()))
    spread = _standard_error(errors) / (2 * rms) if rms > 0 else 0.0
    return FormError(form, degrees, 100 * rms / q_max, 100 * spread / q_max)


def _standard_error(errors: FloatArray) -> float:
    return float(errors.std(ddof=1) / np.sqrt(errors.size))


def _fit_of(form: FlowForm, table: FlowMap, T: float, degrees: Degrees) -> Fit:
    """Fit the whole map, and return the function that fits a part of it in the same way."""
    if form is FlowForm.POLYNOMIALS:
        solve_polynomials(table, degrees)
        return partial(solve_polynomials, degrees=degrees)
    if form in ISO6358_FITS:
        hyperbola = fit_iso6358(table, T=T)
        fit = partial(ISO6358_FITS[form], T=T, start=hyperbola.parameters)
        if form is FlowForm.ISO6358_CURVE and fit(table).sigma > CLOSER * hyperbola.sigma:
            raise FitError("it comes no closer to the map than iso6358, which has fewer parameters")
        return fit
    _, smoothing = smooth_map(table)
    return lambda part: smooth_map(part, smoothing=smoothing)[0]
