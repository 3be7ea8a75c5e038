"""Question: of what is the gap of a real axis made that no effect of the catalogue closes.

Data: the electro-mechanical positioning system (EMPS) of Janot, Gautier and Brunot (2019), read
from the user's own copy. Nothing is random.

The force balance of an axis with asymmetric viscous friction is fitted to the identification record
along its smoothed motion. What is left on the pulse record is taken apart, each step on top of the
ones before and all figures root mean squares of the residual in newtons:

- frozen: everything as identified;
- friction of the record: mass and friction parameters refitted to the pulse record, which shows by
  how much the axis itself has changed between the two records;
- terms over position: smooth functions f(x) and sign(v) f(x), fitted to the identification record
  and frozen;
- repeats: the motion repeats every few seconds, so that the covariance of the residuals of
  different cycles is that part which a function of the motion could describe at all.

Besides: the best sine over the position (ripple of a screw or a pulley), as a share of the squares,
and the term that `discover_term` gives by itself.
"""

import argparse
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import provenance

from pneumo_casadi.data import Case, read_emps
from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.discover.curves import fit_curves
from pneumo_casadi.diagnosis.discover.linear.linearised import Linearised, linearise
from pneumo_casadi.diagnosis.discover.linear.rows import Rows
from pneumo_casadi.diagnosis.discover.linear.sites import Site
from pneumo_casadi.diagnosis.discover.periods import best_period, sines_remove
from pneumo_casadi.diagnosis.discover.search import search
from pneumo_casadi.diagnosis.metrics.residual_size import balance_levels, residual_rms
from pneumo_casadi.diagnosis.prepare.fitted_model import fit_model
from pneumo_casadi.effects import AsymmetricViscousFriction
from pneumo_casadi.parameters import FloatArray

FRICTION = ("f_v", "F_c_plus", "F_c_minus", "asymmetric_viscous_friction.delta_f_v", "M")
POSITION = (Site(("force",), "1", "x"), Site(("force",), "sign(v)", "x"))
#: Shortest and longest period of the motion that is looked for [s].
CYCLE = (2.0, 12.0)


def run(case: Case) -> dict[str, Any]:
    """Return all figures."""
    study, _ = prepare_study(case)
    effects = (AsymmetricViscousFriction(),)
    nominal, fitted = fit_model(study, ()), fit_model(study, effects)
    M = fitted.values["M"]
    frozen = linearise(study, fitted, effects)
    friction_refitted = without_friction(frozen, frozen.held_out.e)
    ladder = {
        "nominal": M * float(residual_rms(nominal)[0]),
        "asymmetric viscous friction": _rms(frozen.held_out, frozen.held_out.e, M),
        "friction of the record": _rms(frozen.held_out, friction_refitted, M),
    }
    training = {
        "nominal": M * float(residual_rms(nominal, held_out=False)[0]),
        "asymmetric viscous friction": _rms(frozen.train, frozen.train.e, M),
    }
    train, e = with_curves(frozen, POSITION)
    training["terms over position"] = _rms(frozen.train, train, M)
    ladder["terms over position"] = _rms(frozen.held_out, without_friction(frozen, e), M)
    best = search(frozen, balance_levels(study))[0]
    return {
        "held_out_rms_N": ladder,
        "training_rms_N": training,
        "closure": {name: 1 - value / ladder["nominal"] for name, value in ladder.items()},
        "change_between_records": _change(frozen),
        "repeats": {
            "training": repeating(frozen.train, frozen.train.e, M),
            "held_out": repeating(frozen.held_out, friction_refitted, M),
        },
        "ripple": [_ripple(frozen, site) for site in POSITION],
        "best_single_term": {
            "balances": best.fit.site.balances,
            "factor": best.fit.site.factor,
            "driver": best.fit.site.driver,
            "formula": best.fit.formula.name,
            "parameters": best.fit.parameters,
            "closes": best.closure,
        },
        **provenance.made(None, quick=False),
    }


def without_friction(linear: Linearised, e: FloatArray) -> FloatArray:
    """Return residuals of the pulse record with mass and friction refitted to it."""
    Q, _ = np.linalg.qr(linear.held_out.A[:, [linear.names.index(name) for name in FRICTION]])
    return e - Q @ (Q.T @ e)


def with_curves(linear: Linearised, sites: Sequence[Site]) -> tuple[FloatArray, FloatArray]:
    """Return the residuals of both records with smooth terms, fitted to the first and frozen."""
    curves = fit_curves(linear, sites)
    train, held_out = (
        rows.e + sum(rows.columns(curve.site, curve.basis) @ curve.coefficients for curve in curves)
        for rows in (linear.train, linear.held_out)
    )
    step = linear.parameter_change(np.concatenate([train, linear.e_map]))
    return train + linear.train.A @ step, held_out + linear.held_out.A @ step


def _rms(rows: Rows, e: FloatArray, M: float) -> float:
    """Return the root mean square of the force balance's residual [N]."""
    r = np.hstack(rows.unweighted(e))[0]
    return float(M * np.sqrt(np.sum(r**2) / np.sum(np.hstack(rows.used)[0])))


def _change(linear: Linearised) -> dict[str, float]:
    """Return by how much the parameters differ on the pulse record [SI]."""
    rows = linear.held_out
    columns = [linear.names.index(name) for name in FRICTION]
    step, *_ = np.linalg.lstsq(rows.A[:, columns], -rows.e, rcond=None)
    values = step * linear.scales[columns]
    return dict(zip(FRICTION, values.tolist(), strict=True))


def repeating(rows: Rows, e: FloatArray, M: float) -> dict[str, float]:
    """Return how much of a residual repeats with the motion."""
    r, used = M * rows.unweighted(e)[0][0], rows.used[0][0]
    v = rows.motions[0].averaged(rows.signals[0].measured["v"])
    t = rows.motions[0].averaged(rows.motions[0].t)
    row = float(t[1] - t[0])
    lags = np.arange(int(CYCLE[0] / row), int(CYCLE[1] / row))
    lag = int(lags[np.argmax([np.corrcoef(v[:-k], v[k:])[0, 1] for k in lags])])
    n = r.size // lag
    whole = used[: n * lag].reshape(n, lag).all(axis=0)
    cycles = r[: n * lag].reshape(n, lag)[:, whole]
    squares = float(np.mean(cycles**2))
    pairs = np.sum(cycles, axis=0) ** 2 - np.sum(cycles**2, axis=0)
    share = float(np.mean(pairs)) / (n * (n - 1)) / squares
    return {
        "period_s": lag * row,
        "share_of_squares": share,
        "rms_that_does_not_repeat_N": float(np.sqrt(squares * (1 - share))),
    }


def _ripple(linear: Linearised, site: Site) -> dict[str, Any]:
    period = best_period(linear, site)
    assert period is not None  # the axis moves
    removed = sines_remove(linear, site, np.array([1 / period]))[0] / np.sum(linear.projected**2)
    return {"factor": site.factor, "period_m": period, "share_of_squares": removed}


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder with the authors' files")
    parser.add_argument("--json", type=Path, help="file to write")
    parser.add_argument("--quick", action="store_true", help="as without: it takes half a minute")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    result = run(read_emps(arguments.data))
    provenance.write(arguments.json, result)
    for name in ("held_out_rms_N", "training_rms_N", "closure", "change_between_records"):
        print(f"{name}: " + ", ".join(f"{k} {v:.3g}" for k, v in result[name].items()))
    for name in ("repeats", "ripple", "best_single_term"):
        print(f"{name}: {result[name]}")


if __name__ == "__main__":
    main()
