"""Question: which unmodelled effect shows on held-out data, and which do parameters hide.

Data: cases of the virtual bench, which shares no equation with the model: one random axis a seed,
without an effect and with each of the bench's effects at medium severity; 10 s at 1 kHz of chirp
and squares to identify on, 10 s of multisine and steps held out. Sizes are scattered by the seed.

Each case: the nominal axis fitted to the balances along the smoothed motion (see `balance_gap`),
the gap of its simulations on the held-out record in closed loop and in windows of 0.5 s (see
`gap`), beside the gap of the same axis without an effect, the background. A gap counts in an output
of a view where it exceeds twice the background, a quarter of the sensor's noise and 0.1 % of the
signal's standard deviation. Verdicts:

- visible: a gap counts somewhere, or the fitted axis cannot be simulated on the held-out record;
- absorbed: none does, but the fit has moved: an X_s, M or a friction coefficient by over 2 % and
  three standard deviations (residuals taken for white) from the fit without the effect, or the
  refined map's residuals at the metered points by over half;
- unobservable: neither; undecided where that is said of a fit that has not settled.

Then, unless `--verdicts` asks for these alone, the catalogue's effect of that name is fitted, where
there is one, and the share of the gap that it closes is told. Effects that the catalogue lacks have
verdicts only.
"""

import argparse
import logging
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import provenance
import tables
from balance_gap import MOVABLE, refit, simulated_gaps, told
from gap import VIEWS, VISIBLE, closed
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pneumo_casadi.diagnosis import prepare_study
from pneumo_casadi.diagnosis.prepare.fitted_model import FittedModel, fit_model
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.report.figures.style import (
    BLUE,
    GREY,
    HEAD,
    ORANGE,
    SMALL,
    VERMILION,
    dress,
    new_figure,
    png,
)
from pneumo_casadi.virtual_bench import FORMS, make_case

#: A gap counts above this share of the sensor's noise, and of the signal [%].
OF_NOISE, OF_SIGNAL = 0.25, 0.1
#: A parameter has moved by so much [%] and so many standard deviations; the map by such a ratio.
MOVED, SIGMAS, MAP_MOVED = 2.0, 3.0, 1.5
NONE = "none"
QUICK = ("constant_force", "valve_dead_zone")


def one_case(seed: int, duration: float, effect: str, refits: bool) -> dict[str, Any]:
    """Return the figures of one effect on one axis, `NONE` for the axis without."""
    logging.disable(logging.WARNING)
    with tempfile.TemporaryDirectory() as scratch:
        asked = {} if effect == NONE else {effect: "medium"}
        made = make_case(Path(scratch) / "case", seed, asked, duration=duration)
        study, _ = prepare_study(made.case)
        before = fit_model(study, ())
        results: dict[str, Any] = {
            "sizes": {k: v for effect in made.effects for k, v in effect.parameters.items()},
            "absorbed_by": [name for effect in made.effects for name in effect.form.absorbed_by],
            "listed": effect in EFFECTS,
            "nominal": told(study, before) | {"errors_percent": errors(before, made.axis.truth)},
            "gap": simulated_gaps(study, before, made.case),
            "motion_m": float(np.ptp(made.case.validate[0]["x"])),
        }
        if refits and effect in EFFECTS:
            own = EFFECTS[effect]()
            after = refit(study, before, own)
            results["refit"] = told(study, after)
            results["refit"] |= {"errors_percent": errors(after, made.axis.truth)}
            results["refit_gap"] = simulated_gaps(study, after, made.case, own)
            results["closed_percent"] = closed(results["gap"], results["refit_gap"])
    return results


def errors(fitted: FittedModel, truth: Mapping[str, float]) -> dict[str, float]:
    """Return the errors of the nominal axis' parameters [%]."""
    return {name: 100 * (fitted.values[name] / truth[name] - 1) for name in MOVABLE}


def judged(entry: Mapping[str, Any], plain: Mapping[str, Any]) -> dict[str, Any]:
    """Return the verdict on an effect beside the same axis without one."""
    moves = moved(entry["nominal"], plain["nominal"])
    if entry["gap"] is None:
        return {"verdict": "visible", "where": ["cannot be simulated"], "moved": moves}
    where = [
        f"{view} {name}"
        for view in VIEWS
        for name, quantity in entry["gap"][view].items()
        if name != "gap_percent" and counts(quantity, plain["gap"][view][name])
    ]
    verdict = "visible" if where else "absorbed" if moves else "unobservable"
    if entry["nominal"]["failure"] and not where:
        verdict = "undecided"
    return {"verdict": verdict, "where": where, "moved": moves}


def counts(result: Mapping[str, float], plain: Mapping[str, float]) -> bool:
    """Return whether the gap of an output is too large for the background, noise and doubt."""
    least = (VISIBLE * plain["gap_percent"], OF_NOISE * result["noise_percent"], OF_SIGNAL)
    return result["gap_percent"] > max(least)


def moved(fit: Mapping[str, Any], plain: Mapping[str, Any]) -> dict[str, float]:
    """Return what an effect has moved: parameters with their shift [%], the map with its ratio."""
    results = {}
    for name in MOVABLE:
        value = fit["parameters"][name]
        old = plain["parameters"][name]
        stds = fit["std"][name], plain["std"][name]
        shift = value - old
        informed = None not in stds and abs(shift) > SIGMAS * np.hypot(*stds)
        if informed and abs(shift) > MOVED / 100 * abs(old):
            results[name] = 100 * shift / abs(old)
    if fit["map_pull"] > MAP_MOVED * plain["map_pull"]:
        results["flow map (ratio of residuals)"] = fit["map_pull"] / plain["map_pull"]
    return results


def run(
    seeds: Sequence[int],
    names: Sequence[str],
    duration: float,
    refits: bool,
    workers: int,
    keep: Path | None,
) -> dict[str, Any]:
    """Return the figures of all effects on all axes; print each as it is done."""
    axes: dict[str, Any] = {}
    tasks = [(seed, name) for seed in seeds for name in (NONE, *names)]
    make = partial(_kept_case, keep, duration, refits)
    with ProcessPoolExecutor(workers) as executor:
        mapped = executor.map(make, *zip(*tasks, strict=True))
        for (seed, name), pair in zip(tasks, mapped, strict=True):
            axis = axes.setdefault(str(seed), {})
            axis[name] = pair
            if name != NONE:
                pair |= judged(pair, axis[NONE])
            elif pair["gap"] is None or pair["nominal"]["failure"]:
                raise RuntimeError(f"axis {seed}: the fit without an effect fails")
            print(_line(seed, name, pair), flush=True)
    return {"duration_seconds": duration, "axes": axes}


def _kept_case(
    keep: Path | None, duration: float, refits: bool, seed: int, effect: str
) -> dict[str, Any]:
    name = f"{seed}_{effect}_{duration:g}s" + ("" if refits else "_verdict")
    return provenance.kept(keep, name, partial(one_case, seed, duration, effect, refits))


def _line(seed: int, name: str, entry: Mapping[str, Any]) -> str:
    gaps = ", ".join(f"{view} {_percent(entry['gap'], view)} %" for view in VIEWS)
    shares = entry.get("closed_percent", {})
    told = ", ".join(f"{shares[view]['all']:.0f} %" for view in shares)
    return (
        f"axis {seed}, {name}: {gaps}; {entry.get('verdict', 'background')}; closed {told or '-'}"
    )


def _percent(gap: Mapping[str, Any] | None, view: str) -> str:
    return "failed" if gap is None else f"{gap[view]['gap_percent']:.2f}"


def draw(result: Mapping[str, Any]) -> Figure:
    """Draw the gap of every effect before and after its refit, over the background."""
    (seed, axis), *_ = result["axes"].items()
    names = [name for name in axis if name != NONE and axis[name]["gap"] is not None]
    names.sort(key=lambda name: axis[name]["gap"]["closed_loop"]["gap_percent"])
    rows = np.arange(len(names))
    figure = new_figure(28 + 3.9 * len(names), head=HEAD)
    panels = figure.subplots(1, 2, sharey=True)
    shown = {"visible": (VERMILION, "s"), "absorbed": (ORANGE, "D")}
    for axes, view, text in zip(panels, VIEWS, ("closed loop", "windows"), strict=True):
        axes.axvline(axis[NONE]["gap"][view]["gap_percent"], color=GREY, linewidth=0.8, zorder=1)
        for row, name in zip(rows, names, strict=True):
            entry = axis[name]
            before = entry["gap"][view]["gap_percent"]
            after = (entry.get("refit_gap") or {}).get(view, {}).get("gap_percent")
            if after is not None:
                axes.plot([before, after], [row, row], color=GREY, linewidth=0.6, zorder=2)
                axes.plot(after, row, "o", color=BLUE, markersize=2.6, zorder=3)
            colour, marker = shown.get(entry["verdict"], (GREY, "v"))
            axes.plot(before, row, marker, color=colour, markersize=2.8, zorder=4)
        axes.set_xscale("log")
        dress(axes, f"gap, {text} [%]")
    panels[0].set_yticks(rows, [name.replace("_", " ") for name in names], fontsize=SMALL - 0.5)
    panels[0].set_ylim(-0.7, len(names) - 0.3)
    styles = [("visible", VERMILION, "s"), ("absorbed", ORANGE, "D"), ("neither", GREY, "v")]
    if any("refit" in entry for entry in axis.values()):
        styles.append(("after refit", BLUE, "o"))
    styles.append((f"no effect (axis {seed})", GREY, ""))
    handles = [
        Line2D([], [], color=c, marker=m, linestyle="" if m else "-", markersize=3, label=text)
        for text, c, m in styles
    ]
    figure.legend(
        handles=handles,
        loc="upper center",
        ncols=5,
        frameon=False,
        fontsize=SMALL - 0.5,
        columnspacing=0.6,
        handletextpad=0.3,
        handlelength=0.9,
        borderaxespad=0.1,
    )
    return figure


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="write the figure to this PNG file")
    parser.add_argument(
        "--keep", type=Path, help="keep finished cases here, and take them up again"
    )
    parser.add_argument("--seeds", type=int, default=1, help="number of axes, counted from 0")
    parser.add_argument("--duration", type=float, default=10.0, help="of each record [s]")
    parser.add_argument("--verdicts", action="store_true", help="verdicts only, no refits")
    parser.add_argument("--workers", type=int, default=1, help="cases at a time")
    parser.add_argument("--quick", action="store_true", help="one axis, two effects, four seconds")
    arguments = parser.parse_args()
    if arguments.keep is not None:
        arguments.keep.mkdir(parents=True, exist_ok=True)
    seeds = list(range(1 if arguments.quick else arguments.seeds))
    names, duration = (QUICK, 4.0) if arguments.quick else (tuple(FORMS), arguments.duration)
    refits = not arguments.verdicts
    result = run(seeds, names, duration, refits, arguments.workers, arguments.keep)
    result |= provenance.made(None, arguments.quick) | {"seed": seeds}
    print(tables.effect_visibility(result))
    provenance.write(arguments.json, result)
    if arguments.figure is not None:
        arguments.figure.write_bytes(png(draw(result)))


if __name__ == "__main__":
    main()
