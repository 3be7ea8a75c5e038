"""`result.json`: an identification as strict JSON; `read_result` gives the axis back."""

from collections.abc import Mapping
from typing import Any

from pneumo_casadi.data.record_ranges import record_ranges
from pneumo_casadi.errors import ModelError
from pneumo_casadi.estimation.output_error import OutputErrorResult, RecordEstimates
from pneumo_casadi.estimation.output_error.conductance import conductances
from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.model_file import axis_dict
from pneumo_casadi.identification.options import output_error_options
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.input_files import printable
from pneumo_casadi.runtime.json_files import without_infinities
from pneumo_casadi.runtime.provenance import provenance
from pneumo_casadi.validation import Error, Validation
from pneumo_casadi.valve import FlowForm

#: Of the format; raised when a reader of the old one would misread the new.
FORMAT = 1
#: Note of a parameter that was not estimated, and of one whose estimate has no interval.
HELD = "held fixed"
NOTES = {
    EstimateStatus.HELD: HELD,
    EstimateStatus.AT_BOUND: "held by a bound; the interval is one-sided",
    EstimateStatus.UNINFORMED: "the data say nothing about it",
    EstimateStatus.NOT_CONVERGED: "the fit has not converged",
}


def result_dict(identification: Identification) -> dict[str, Any]:
    """Return an identification as plain values: no NaN, no infinity.

    A standard deviation that does not exist (no information, a bound, a parameter held fixed)
    is None, with a ``note`` beside it.
    """
    flow = None
    if identification.flow is not None:
        selection = identification.flow_selection  # None for an unmetered valve
        degrees = None if selection is None else selection.degrees
        form = FlowForm.ISO6358 if selection is None else selection.chosen
        flow = {
            "form": form.value,
            "degrees": None if degrees is None else list(degrees),
            "selection": None if selection is None else selection.as_dict(),
            "p_range": list(identification.flow.p_range),
            "sigma": identification.flow.sigma,
            "conductance": conductances(
                identification.output_error, identification.flow_map, identification.flow
            ),
            "parameters": _estimates(
                identification.output_error, identification.flow.parameters.names
            ),
        }
    content = {
        "format": FORMAT,
        "case": identification.case.name,
        "folder": printable(str(identification.case.folder.resolve())),
        "usable": identification.usability.usable.value,
        "reason": identification.usability.reason,
        "warnings": [
            {"grade": item.grade.value, "text": item.text, "about": item.about}
            for item in identification.warnings
        ],
        "wls": identification.wls.as_dict(),
        "output_error": output_error_dict(identification.output_error, identification),
        "each_record": _each_record(identification.each_record),
        "flow": flow,
        "model": _model(identification.axis),
        "validation": None
        if identification.validation is None
        else validation_dict(identification.validation),
        "cross_validation": {
            p.name: {"relative_error_percent": dict(p.relative_error_percent)}
            for p in identification.predictions
        },
        "truth": None if identification.truth is None else dict(identification.truth),
        "provenance": identification_provenance(identification),
        "seconds": identification.seconds,
    }
    plain: dict[str, Any] = without_infinities(content)
    return plain


def output_error_dict(result: OutputErrorResult, identification: Identification) -> dict[str, Any]:
    """Return an output-error fit as plain values."""
    flow = set(result.axis.flow_parameters)
    own = [name for name in result.parameters.names if name not in flow and name != "v_s"]
    correlation = result.uncertainty.correlation
    names = [name for name in own if name in result.uncertainty.names]
    at = [result.uncertainty.names.index(name) for name in names]
    deviation = result.flow_map_deviation
    return {
        "status": result.status,
        "iterations": result.iterations,
        "cost": result.cost,
        "chosen_window_s": result.chosen_window,
        "parameters": _estimates(result, own),
        "derived": {
            name: {
                "value": item.value,
                **_interval(result, name),
                "unit": item.unit,
            }
            for name, item in result.derived.items()
        },
        "fixed": {"v_s": {"value": result.parameters["v_s"].value, "unit": "m/s"}},
        "sigma": dict(zip(result.axis.outputs, map(float, result.sigma), strict=True)),
        "stages": [
            {
                "name": stage.name,
                "v_s": stage.v_s,
                "cost": stage.cost,
                "iterations": stage.iterations,
                "status": stage.status,
                "seconds": stage.seconds,
            }
            for stage in result.stages
        ],
        "correlation": {
            "names": names,
            "matrix": [[float(correlation[i, j]) for j in at] for i in at],
        },
        "map_pull": None if deviation is None else {"rms": deviation.rms, "scale": deviation.scale},
        "at_bound": list(result.uncertainty.at_bound),
        "uninformed": list(result.uncertainty.uninformed),
        "uninformed_directions": list(result.uncertainty.combinations),
    }


def validation_dict(validation: Validation) -> dict[str, Any]:
    """Return a validation as plain values: open loop by channel, then the other two."""
    closed = validation.closed_loop
    return {
        **_errors(validation.open_loop),
        "closed_loop": None if closed is None else _errors(closed),
        "windows": {f"{length:g}": _errors(e) for length, e in validation.windows.items()},
        "records": [run.record.name for run in validation.runs],
    }


def identification_provenance(identification: Identification) -> dict[str, Any]:
    """Return what is needed to repeat an identification: options, versions, hashes of the data."""
    case, options = identification.case, identification.options
    chosen = output_error_options(case, options)
    return provenance(
        case.files,
        {
            "flow_form": None if options.flow_form is None else options.flow_form.value,
            "degrees": None if options.degrees is None else list(options.degrees),
            "refine_flow": options.refine_flow,
            "start": options.start,
            "end": options.end,
            "effects": list(options.effects),
            "fixed": dict(options.fixed),
            "start_values": dict(options.start_values),
            "method": chosen.method.value,
            "block": chosen.block,
            "window": chosen.window,
            "interval": chosen.interval,
            "closed_loop": chosen.closed_loop,
            "friction_widths": list(chosen.widths),
            "reweight": chosen.reweight,
            "max_iterations": chosen.max_iterations,
            "validation_windows": list(options.windows),
        },
        seeds={},  # no random number enters an identification
        records=record_ranges({"fitted": identification.records, "held out": case.validate}),
        made=identification.made,
    )


def _each_record(alone: RecordEstimates | None) -> dict[str, Any] | None:
    if alone is None:
        return None
    return {
        "records": {
            record: {
                name: {"value": float(value), "std_robust": float(std)}
                for name, value, std in zip(alone.names, values, stds, strict=True)
            }
            for record, values, stds in zip(alone.records, alone.values, alone.std, strict=True)
        },
        "spread": {name: alone.spread(name) for name in alone.names},
        "failed": list(alone.failed),
    }


def _model(axis: Axis) -> dict[str, Any] | None:
    try:
        return axis_dict(axis)
    except ModelError:  # an effect or a flow map of one's own: no file can hold it
        return None


def _estimates(result: OutputErrorResult, names: Any) -> dict[str, dict[str, Any]]:
    estimates = {}
    for name in names:
        item = result.parameters[name]
        entry: dict[str, Any] = {
            "value": item.value,
            **_interval(result, name),
            "unit": item.unit,
        }
        note = NOTES.get(result.status_of(name))
        if note is not None:
            entry["note"] = note
        estimates[name] = entry
    return estimates


def _interval(result: OutputErrorResult, name: str) -> dict[str, Any]:
    """Return status and standard deviations of an estimate; None where there is no interval."""
    status = result.status_of(name)
    known = status is EstimateStatus.ESTIMATED
    return {
        "std": result.std(name) if known else None,
        "std_robust": result.std(name, robust=True) if known else None,
        "status": status.value,
    }


def _errors(errors: Mapping[str, Error]) -> dict[str, dict[str, Any]]:
    return {
        name: {
            "rms": error.rms,
            "percent": error.percent,
            "noise_percent": error.noise_percent,
            "unit": error.unit,
        }
        for name, error in errors.items()
    }
