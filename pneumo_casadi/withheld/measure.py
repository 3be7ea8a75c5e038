"""What the labels allow to measure: whether a cause shows, an oracle, and simple rivals.

All of it is done with one machinery, the fits of the balances along the smoothed motion, on the
case and on its *twin*: the same axis, references and noise without an effect.

- A cause is *visible* where the residual of the nominal axis on the held-out record exceeds that
  of the twin `VISIBLE` times in some balance.
- The gap is √Σ max((rms/rms of the twin)² − 1, 0) over the balances of the held-out record, and a
  shrink is 1 − gap after/gap before. The oracle's is that of the axis with the true effects; it is
  compared with that of the axis with the effects named. Neither uses figures that the diagnosis
  states.
- Rivals see the training record alone: the ranking of single effects by training error, and forward
  selection by AIC. The cost of a fit is a concentrated negative log-likelihood L, AIC/2 = L + n.
  After its first step the selection goes on among the `BEAM` best only.
"""

import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.diagnosis.study import Fitted, Study, fit, study
from pneumo_casadi.effect import Effect
from pneumo_casadi.effects import CATALOGUE
from pneumo_casadi.errors import PneumoError
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.pipeline import FlowForm, IdentifyOptions, make_axis, read_flow
from pneumo_casadi.recording import Case, load_case
from pneumo_casadi.result_file import write_json
from pneumo_casadi.withheld.draw import Draw, make_twin

#: A cause shows where it more than doubles the energy of a residual (1.5² = 2.25): what is missing
#: then outweighs all that noise, filters and the model's form leave.
VISIBLE = 1.5
#: Effects that forward selection adds at most, and those that it tries after its first step.
MOST, BEAM = 3, 5


def measure_one(
    folder: Path, case: Path, draw: Draw, named: Collection[str], duration: float, fs: float
) -> None:
    """Measure one case and write the figures to ``folder/NAME.json``."""
    try:
        with tempfile.TemporaryDirectory() as scratch:
            twin = opened_study(make_twin(draw, Path(scratch) / "twin", duration, fs))
            found = measured(opened_study(load_case(case)), twin, draw, named)
    except (PneumoError, np.linalg.LinAlgError) as error:
        found = {"failure": f"{type(error).__name__}: {error}"}
    write_json(found, folder / f"{draw.name}.json")


def opened_study(case: Case) -> Study:
    """Start the fits of a case."""
    table, flow = read_flow(case, IdentifyOptions(flow_form=FlowForm.ISO6358))
    return study(make_axis(case, flow), table, case.identify, case.validate)


def measured(one: Study, twin: Study, draw: Draw, named: Collection[str]) -> dict[str, Any]:
    """Return the figures of one case beside its twin."""
    nominal = fit(one, ())
    floor = held_out_rms(fit(twin, ()))
    before = held_out_rms(nominal)
    names = tuple(draw.effects)
    catalogue = {key: found for key, found in CATALOGUE.items() if key not in draw.without}

    def shrink(effects: Iterable[str]) -> float | None:
        chosen = [CATALOGUE[name]() for name in effects if name in CATALOGUE]
        after = tried(one, chosen, nominal)
        return None if after is None else shrunk(before, held_out_rms(after), floor)

    knows = bool(names) and draw.listed
    oracle = shrink(names) if knows else None
    same = set(named) == set(names)
    return {
        "rms": dict(zip(one.axis.equations, before.tolist(), strict=True)),
        "twin_rms": dict(zip(one.axis.equations, floor.tolist(), strict=True)),
        "visible": bool(np.any(before > VISIBLE * floor)),
        "oracle_shrink": oracle,
        "named_shrink": oracle if knows and same else shrink(named) if knows and named else 0.0,
        **rivals(one, nominal, catalogue),
    }


def held_out_rms(one: Fitted) -> FloatArray:
    """Return the root mean square residual of each balance on the held-out records, (ne,)."""
    squares = sum(
        (r**2 * used).sum(axis=1) for r, used in zip(one.held_out, one.used_held_out, strict=True)
    )
    rows = sum(used.sum(axis=1) for used in one.used_held_out)
    return np.asarray(np.sqrt(squares / np.maximum(rows, 1)))


def gap(rms: FloatArray, floor: FloatArray) -> float:
    """Return what of the residuals lies above those of the twin, in units of these."""
    return float(np.sqrt(np.maximum((rms / floor) ** 2 - 1, 0.0).sum()))


def shrunk(before: FloatArray, after: FloatArray, floor: FloatArray) -> float:
    """Return 1 − gap after/gap before; 0 where there is no gap before.

    Examples
    --------
    >>> floor = np.array([1.0, 1.0])
    >>> shrunk(np.array([3.0, 1.0]), np.array([1.0, 0.9]), floor)
    1.0
    """
    first = gap(before, floor)
    return 1.0 - gap(after, floor) / first if first > 0 else 0.0


def tried(one: Study, effects: Sequence[Effect], nominal: Fitted) -> Fitted | None:
    """Fit with some effects; None where the axis cannot have them or the fit fails."""
    try:
        return fit(one, effects, nominal.values)
    except (PneumoError, np.linalg.LinAlgError):
        return None


def rivals(one: Study, nominal: Fitted, catalogue: Mapping[str, type[Effect]]) -> dict[str, Any]:
    """Return what ranking by training error, and forward selection by AIC, make of a case."""
    costs: dict[tuple[str, ...], float] = {}

    def cost(names: tuple[str, ...]) -> float:
        found = tried(one, [catalogue[name]() for name in names], nominal)
        if found is not None:
            costs[names] = found.cost
        return np.inf if found is None else found.cost + len(found.std)

    score = {name: cost((name,)) for name in catalogue}
    ranked = sorted((c, names[0]) for names, c in costs.items())
    return {
        "by_error": [name for _, name in ranked],
        "by_aic": forward(score, nominal.cost + len(nominal.std), cost),
    }


def forward(
    single: Mapping[str, float], without: float, cost: Callable[[tuple[str, ...]], float]
) -> list[str]:
    """Add effects while a criterion falls, each time the best.

    Parameters
    ----------
    single : mapping of str to float
        Criterion of each effect alone.
    without : float
        Criterion without effects.
    cost : callable
        Criterion of several.

    Examples
    --------
    >>> forward({"a": 5.0, "b": 4.0, "c": 9.0}, 8.0, lambda names: 3.0 if "a" in names else 6.0)
    ['b', 'a']
    """
    chosen: list[str] = []
    best, beam = without, sorted(single, key=lambda name: single[name])[:BEAM]
    while len(chosen) < MOST:
        rest = [name for name in beam if name not in chosen]
        found = {n: single[n] if not chosen else cost((*chosen, n)) for n in rest}
        name = min(found, key=lambda key: found[key], default=None)
        if name is None or not found[name] < best:
            break
        chosen.append(name)
        best = found[name]
    return chosen
