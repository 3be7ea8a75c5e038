"""Which of the effects that act together has the largest gap in the balances.

A weak effect is drawn by its size, a tenth of medium, and what a size does depends on the axis: the
weak shift of a valve's null may do more to one axis than a medium play does to another. So the
virtual bench records a case again without each of its effects: the same axis, references and noise.
The diagnosis has no part in it. Simulations weigh effects differently: there a valve's hysteresis
does less, and what drifts does more.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.metrics.residual_size import residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.evaluation.sealed_check.draw import Draw, make
from pneumo_casadi.metrics import combined_gap, gap
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.atomic_files import draft_folder
from pneumo_casadi.virtual_bench import ALL_FORMS


def gaps_without(draw: Draw, twin: FloatArray, duration: float, fs: float) -> dict[str, float]:
    """Return the gap that an axis with one cause keeps without each of its effects, by cause.

    It is the gap of the nominal axis, fitted to that record, in all balances of the record held
    out, in units of what the axis without any effect leaves; see `combined_gap`.

    Parameters
    ----------
    draw : Draw
        The case.
    twin : (ne,) array
        What the nominal axis leaves without the cause, see `nominal_rms`.
    duration, fs : float
        Length of each record [s] and sampling frequency [Hz].
    """
    with draft_folder() as scratch:
        floor = nominal_rms(
            replace(draw, effects={}, background=()), scratch / "floor", duration, fs
        )
        left = dict.fromkeys(draw.effects, twin) | {
            cause: nominal_rms(rest, scratch / cause, duration, fs)
            for cause, rest in without_each(draw)
        }
        return {cause: combined_gap(gap((rms / floor) ** 2, 1.0)) for cause, rms in left.items()}


def without_each(draw: Draw) -> Iterator[tuple[str, Draw]]:
    """Return the case without each of its weak effects in turn, with the cause that is missing.

    Examples
    --------
    >>> from pneumo_casadi.evaluation.sealed_check.draw import Kind
    >>> draw = Draw("w001", Kind.SINGLE, 1, {"hose": "large"}, {}, ("stribeck_gaussian",))
    >>> [(cause, list(rest.effects), rest.background) for cause, rest in without_each(draw)]
    [('stribeck', ['hose'], ())]
    """
    for form in draw.background:
        rest = tuple(name for name in draw.background if name != form)
        yield ALL_FORMS[form].cause, replace(draw, background=rest)


def nominal_rms(draw: Draw, folder: Path, duration: float, fs: float) -> FloatArray:
    """Record a case and return what the nominal axis leaves in each balance, (ne,), held out."""
    study, _ = prepare_study(make(draw, folder, duration, fs))
    return residual_rms(fit_model(study, ()))


def largest_of(gaps: Mapping[str, float]) -> str:
    """Return the cause without which the gap is least.

    Examples
    --------
    >>> largest_of({"backlash": 8.1, "valve_null_shift": 3.2})
    'valve_null_shift'
    """
    return min(gaps, key=lambda cause: gaps[cause])
