"""`result.json` read back: to an axis, or to the options of a further identification."""

import json
from pathlib import Path
from typing import Any

from pneumo_casadi.data import Case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result_file import HELD
from pneumo_casadi.identification.starting_axis import catalogue_effect, make_axis, started_from
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.provenance import sha256
from pneumo_casadi.valve import FlowForm


def read_axis(path: str | Path, case: Case) -> Axis:
    """Return the axis that a `result.json` describes, on the bench of a case.

    Parameters
    ----------
    path : path
        Folder of a report, or its `result.json`, written by ``identify`` or ``diagnose``.
    case : Case
        Supplies bench and flow map; the map must be the one of the identification, since the
        coefficients are in its scaling.

    Raises
    ------
    CaseError
        If the file is no such result, or does not fit the case.
    """
    path = result_path(path)
    content = read_result(path)
    try:
        estimates = content["output_error"]["parameters"] | content["output_error"]["fixed"]
        flow = content["flow"]
        if flow is not None:
            estimates |= flow["parameters"]
        values = {str(name): float(item["value"]) for name, item in estimates.items()}
        options = IdentifyOptions()
        if flow is not None:
            options = IdentifyOptions(FlowForm(flow["form"]), _degrees(flow["degrees"]))
        effects = effects_in(content)
        hashes = dict(content["provenance"]["sha256"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CaseError(
            f"{path}: not a result of `identify` ({type(error).__name__}: {error}); give its "
            "result.json"
        ) from None
    table, model = read_flow(case, options)
    if (model is None) != (flow is None):
        raise CaseError(f"{path}: servo axis and force-driven axis do not go together")
    for file in (case.flow_map_path, case.flow_map_N_path):
        if file is not None and table is not None:
            _check_map(file, hashes.get(file.name), path)
    axis = make_axis(case, model).with_effects(*(catalogue_effect(n, model) for n in effects))
    unknown = sorted(set(values) - set(axis.parameters.names))
    missing = sorted(set(axis.parameters.names) - set(values))
    if unknown or missing:
        raise CaseError(
            f"{path}: parameters do not match the axis of {case.folder}: "
            f"{', '.join(unknown + missing)}"
        )
    return axis.with_parameters(values)


def read_options(path: str | Path, case: Case) -> IdentifyOptions:
    """Return the options of an identification of a case that starts from a result.

    With its form of the flow map, its effects, and its held parameters held.

    Parameters
    ----------
    path : path
        As in `read_axis`.
    case : Case
        That of the result, or one with the same flow map.

    Raises
    ------
    CaseError
        As in `read_axis`.
    """
    axis = read_axis(path, case)
    content = read_result(result_path(path))
    items = content["output_error"]["parameters"]
    flow = content["flow"]
    options = IdentifyOptions(
        flow_form=None if flow is None else FlowForm(flow["form"]),
        degrees=None if flow is None else _degrees(flow["degrees"]),
        effects=effects_in(content),
    )
    held = [name for name, item in items.items() if item.get("note") == HELD]
    return started_from(options, axis, axis.parameters.as_dict(), held)


def effects_in(content: Any) -> tuple[str, ...]:
    """Return the names of the effects of a result's model; files of 0.1 may have no model."""
    model = content.get("model")
    return () if model is None else tuple(str(name) for name in model["effects"])


def _degrees(content: Any) -> tuple[int, int, int] | None:
    if content is None:  # a form without degrees
        return None
    first, second, third = (int(degree) for degree in content)
    return first, second, third


def _check_map(flow_map: Path, expected: str | None, result: Path) -> None:
    if sha256(flow_map) != expected:
        raise CaseError(
            f"{flow_map}: not the flow map that {result} was identified with; copy that map here, "
            "or identify this case anew"
        )


def result_path(path: str | Path) -> Path:
    """Return the file of a result, given itself or its folder."""
    path = Path(path)
    return path / "result.json" if path.is_dir() else path


def read_result(path: Path) -> Any:
    """Return the content of a `result.json`.

    Raises
    ------
    CaseError
        If there is no such file, or it is no JSON.
    """
    try:
        return json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise CaseError(f"{path}: no such file; `identify` writes result.json") from None
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: not a readable JSON file ({error})") from None
