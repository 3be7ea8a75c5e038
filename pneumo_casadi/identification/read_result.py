"""`result.json` read back: to an axis, or to the options of a further identification."""

from pathlib import Path

from msgspec import field

from pneumo_casadi.data import Case
from pneumo_casadi.data.bench.driven_bench import is_metered
from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.identification.flow_form import read_flow
from pneumo_casadi.identification.model_file import AxisSection, check_unit
from pneumo_casadi.identification.options import IdentifyOptions
from pneumo_casadi.identification.result_file import FORMAT, HELD
from pneumo_casadi.identification.starting_axis import catalogue_effect, make_axis, started_from
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.runtime.json_input import Section, check_format, read_json, typed
from pneumo_casadi.runtime.provenance import sha256
from pneumo_casadi.valve import FlowForm
from pneumo_casadi.valve.flow_file import Degree


class EstimateSection(Section):
    """An estimated parameter."""

    value: float
    unit: str
    std: float | None = None
    std_robust: float | None = None
    note: str | None = None
    status: str | None = None


class OutputErrorSection(Section):
    """The fit by output error."""

    parameters: dict[str, EstimateSection]
    fixed: dict[str, EstimateSection] = field(default_factory=dict)
    derived: dict[str, EstimateSection] = field(default_factory=dict)


class FlowSection(Section):
    """The form of the flow map and its coefficients."""

    form: FlowForm
    degrees: tuple[Degree, Degree, Degree] | None
    parameters: dict[str, EstimateSection]


class ProvenanceSection(Section):
    """Hashes of the data, by file name."""

    sha256: dict[str, str]


class ResultSection(Section):
    """What is read of a `result.json`; files of 0.1 may lack `folder` and `model`."""

    case: str
    output_error: OutputErrorSection
    flow: FlowSection | None
    provenance: ProvenanceSection
    folder: str | None = None
    model: AxisSection | None = None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects of the model."""
        return () if self.model is None else tuple(self.model.effects)


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
    estimates = content.output_error.parameters | content.output_error.fixed
    options = IdentifyOptions()
    if content.flow is not None:
        estimates |= content.flow.parameters
        options = IdentifyOptions(content.flow.form, content.flow.degrees)
    table, model = read_flow(case, options)
    if (model is None) != (content.flow is None):
        raise CaseError(f"{path}: servo axis and force-driven axis do not go together")
    for file in (case.flow_map_path, case.flow_map_N_path):
        if file is not None and table is not None:
            _check_map(file, content.provenance.sha256.get(file.name), path)
    try:
        metered = is_metered(case.bench)
        effects = [catalogue_effect(name, model, metered) for name in content.effects]
        axis = make_axis(case, model).with_effects(*effects)
        unknown = sorted(set(estimates) - set(axis.parameters.names))
        missing = sorted(set(axis.parameters.names) - set(estimates))
        if unknown or missing:
            raise CaseError(
                f"parameters do not match the axis of {case.folder}: "
                f"{', '.join(unknown + missing)}; if another version has written the file, "
                "identify anew"
            )
        for name, item in estimates.items():
            check_unit(axis.parameters[name], item.unit)
        return axis.with_parameters({name: item.value for name, item in estimates.items()})
    except (CaseError, ModelError) as error:
        raise CaseError(f"{path}: {error}") from None


def read_options(path: str | Path, case: Case) -> IdentifyOptions:
    """Return the options of an identification of a case that starts from a result.

    With its form of the flow map, its effects, and its held parameters held, the coefficients of
    the map among them.

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
    flow = content.flow
    coefficients = {} if flow is None else flow.parameters
    refined = not coefficients or any(item.note != HELD for item in coefficients.values())
    options = IdentifyOptions(
        flow_form=None if flow is None else flow.form,
        degrees=None if flow is None else flow.degrees,
        effects=content.effects,
        refine_flow=refined,
    )
    items = content.output_error.parameters
    held = [name for name, item in items.items() if item.note == HELD]
    values = axis.parameters.as_dict()
    if not refined:
        values = {name: value for name, value in values.items() if name not in coefficients}
    return started_from(options, axis, values, held)


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


def read_result(path: Path) -> ResultSection:
    """Return what a `result.json` holds.

    Raises
    ------
    CaseError
        If there is no such file, or it is no result of a format that is known.
    """
    content = read_json(path, "`identify` writes result.json")
    try:
        check_format(content, FORMAT)
        return typed(content, ResultSection)
    except CaseError as error:
        raise CaseError(
            f"{path}: not a result of `identify`: {error}; give its result.json"
        ) from None
