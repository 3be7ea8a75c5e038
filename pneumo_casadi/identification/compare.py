"""Results compared: which parameters moved, and how well each simulates the others' records."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot, inf
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.data import Case
from pneumo_casadi.data.record_ranges import record_ranges
from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.errors import CaseError, FitError, ModelError
from pneumo_casadi.estimation.flow_scale import flow_scale_covariance
from pneumo_casadi.identification.compared_model import ComparedModel, Estimate, compared_model
from pneumo_casadi.identification.comparison import Comparison, CrossSimulation, Difference
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.runtime.progress import Progress, no_progress, progress_range
from pneumo_casadi.runtime.provenance import provenance
from pneumo_casadi.runtime.threads import one_thread
from pneumo_casadi.validation.errors import errors_of_runs
from pneumo_casadi.validation.simulations import window_curves, window_runs

#: Length of the windows of the simulations [s]: longer than the axis remembers, shorter than an
#: open-loop position drifts.
WINDOW = 2.0


@one_thread
def compare(
    *results: Identification | Case | str | Path, progress: Progress | None = None
) -> Comparison:
    """Compare results: which parameters moved, and how well each simulates the others' records.

    Parameters
    ----------
    *results : Identification, Case or path
        Two or more: identifications, report folders or `result.json` of ``identify`` or
        ``diagnose``, or cases and their folders, which are identified first. The others are
        compared with the first.
    progress : callable, optional
        Called as ``progress(text, share)``.

    Returns
    -------
    Comparison

    Raises
    ------
    CaseError
        If there are fewer than two, one cannot be read, or the kinds of axis differ.
    FitError
        If a case cannot be identified.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``, compared with itself:

    >>> comparison = pc.compare(result, result)
    >>> [item.name for item in comparison.differences if item.moved]
    []
    """
    if len(results) < 2:
        raise CaseError("compare: give two or more results or cases")
    report = progress or no_progress
    share = 0.6 / len(results)
    models = [
        compared_model(item, progress_range(report, i * share, (i + 1) * share, f"{i + 1}: "))
        for i, item in enumerate(results)
    ]
    _refuse_different_kinds(models)
    names = _labels([model.name for model in models])
    parameters = dict.fromkeys(name for model in models for name in model.estimates)
    estimates = {name: tuple(model.estimates.get(name) for model in models) for name in parameters}
    simulations, curves, failures = _simulate_all(models, names, progress_range(report, 0.6, 1.0))
    report("done", 1.0)
    return Comparison(
        names,
        estimates,
        tuple(_differences(models, names)),
        simulations,
        (*_notes(models, names), *failures),
        curves,
        _provenance(models, names),
    )


def _provenance(models: Sequence[ComparedModel], names: Sequence[str]) -> dict[str, Any]:
    """Return what is needed to repeat a comparison: records and hashes, by result."""
    records = record_ranges(
        {f"simulated, of {name}": each.records for name, each in zip(names, models, strict=True)}
    )
    hashes = {
        f"{name}: {file}": value
        for name, each in zip(names, models, strict=True)
        for file, value in each.sources.items()
    }
    origin = provenance([], {"results": list(names), "window": WINDOW}, records=records)
    return origin | {"sha256": hashes}


def _labels(names: Sequence[str]) -> tuple[str, ...]:
    """Return names that differ: equal ones get a letter."""
    letters = [chr(ord("A") + i) for i in range(len(names))]
    return tuple(
        name if names.count(name) == 1 else f"{name} ({letter})"
        for name, letter in zip(names, letters, strict=True)
    )


def _refuse_different_kinds(models: Sequence[ComparedModel]) -> None:
    kinds = {model.axis.kind.title for model in models if model.axis is not None}
    if len(kinds) > 1:
        raise CaseError(f"compare: axes of different kinds: {' and '.join(sorted(kinds))}")


def _differences(models: Sequence[ComparedModel], names: Sequence[str]) -> list[Difference]:
    first, *others = models
    parameters = dict.fromkeys(name for model in models for name in model.estimates)
    differences = []
    for name in parameters:
        for label, other in zip(names[1:], others, strict=True):
            if name not in first.estimates or name not in other.estimates:
                continue
            own, theirs = _apart(first, other, name)
            change, std = theirs.value - own.value, hypot(own.std, theirs.std)
            known = 0 < std < inf
            percent = 100 * change / abs(own.value) if own.value else (inf if change else 0.0)
            differences.append(Difference(name, label, percent, change / std if known else None))
    return differences


def _apart(first: ComparedModel, other: ComparedModel, name: str) -> tuple[Estimate, Estimate]:
    """Return the estimates of a parameter without the error of a flow meter that both share.

    One map has one meter: its factor is the same in both results, and in no difference.
    """
    pair = first.estimates[name], other.estimates[name]
    maps = [_hashes(model, "flow_map") for model in (first, other)]
    if not maps[0] or maps[0] != maps[1]:
        return pair
    shared = [
        0.0
        if model.axis is None
        else flow_scale_covariance([name], np.array([estimate.value]), model.axis)[0, 0]
        for model, estimate in zip((first, other), pair, strict=True)
    ]
    own, theirs = (
        replace(estimate, std=max(estimate.std**2 - variance, 0.0) ** 0.5)
        for estimate, variance in zip(pair, shared, strict=True)
    )
    return own, theirs


def _simulate_all(
    models: Sequence[ComparedModel], names: Sequence[str], progress: Progress
) -> tuple[tuple[CrossSimulation, ...], tuple[Curves, ...], tuple[str, ...]]:
    """Return errors, outputs over time, and why simulations failed."""
    simulations, curves, failures = [], [], []
    for j, (owner, records_of) in enumerate(zip(models, names, strict=True)):
        if owner.axis is None or not owner.records:
            continue
        window = min(WINDOW, *(record.duration - 2 * record.dt for record in owner.records))
        runs = {}
        for i, (model, name) in enumerate(zip(models, names, strict=True)):
            if model.axis is None:
                continue
            progress(f"{name} on {records_of}", (j * len(models) + i) / len(models) ** 2)
            try:
                runs[name] = window_runs(model.axis, owner.records, window)
            except (ModelError, FitError, CaseError) as error:
                failures.append(f"{name} could not simulate the records of {records_of}: {error}")
                continue
            errors = errors_of_runs(model.axis, runs[name])
            simulations.append(CrossSimulation(name, records_of, errors))
        drawn = window_curves(owner.axis, runs)
        curves += [replace(each, record=f"{records_of} {each.record}") for each in drawn]
    return tuple(simulations), tuple(curves), tuple(failures)


def _notes(models: Sequence[ComparedModel], names: Sequence[str]) -> list[str]:
    notes = []
    for model, name in zip(models, names, strict=True):
        if model.note:
            notes.append(f"{name}: its records are not simulated ({model.note})")
        elif not model.held_out:
            notes.append(f"{name} has no held-out record: its own error is that of the fit")
    for model, name in zip(models[1:], names[1:], strict=True):
        if _hashes(model, "identify") & _hashes(models[0], "identify"):
            notes.append(
                f"{names[0]} and {name} come from the same records, whose noise they share: the "
                "σ tell the size of a difference, and are no test"
            )
        elif _hashes(model, "flow_map") != _hashes(models[0], "flow_map"):
            notes.append(
                f"{names[0]} and {name} have different flow maps: X_s1 ... X_s6 also differ by "
                "the accuracy of the flow meters, which is in no interval unless it is stated"
            )
    return notes


def _hashes(model: ComparedModel, start: str) -> set[str]:
    return {value for name, value in model.sources.items() if name.startswith(start)}
