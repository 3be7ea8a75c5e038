"""What is exported: an axis with its start, its sampling period and where it comes from."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pneumo_casadi.errors import CaseError, ModelError
from pneumo_casadi.estimation.statistics import EstimateStatus
from pneumo_casadi.identification.model_file import AxisSection, axis_dict, axis_of_section
from pneumo_casadi.identification.read_result import ResultSection, result_path
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import result_dict
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.balances import load_force
from pneumo_casadi.model.stepping import substeps_for
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.runtime.json_files import json_text
from pneumo_casadi.runtime.json_input import Section, check_format, read_json, typed
from pneumo_casadi.runtime.output_folder import write_files

#: Of axis.json; raised when a reader of the old one would misread the new.
FORMAT = 1
_KIND = "pneumo_casadi model"
#: Estimates that a description of the model marks.
UNTRUSTED = (
    EstimateStatus.AT_BOUND,
    EstimateStatus.UNINFORMED,
    EstimateStatus.NOT_CONVERGED,
)


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """An axis, ready to be written for other tools.

    Parameters
    ----------
    axis : Axis
        With the parameters to export.
    dt : float
        Sampling period of the discrete step [s].
    name : str
        Name of the case, for titles.
    provenance : mapping
        Versions, hashes of the data, options: what is needed to repeat the identification.
    estimates : mapping
        Parameters with their standard deviations, as in `result.json`.

    Raises
    ------
    ModelError
        If the sampling period is not positive.
    """

    axis: Axis
    dt: float
    name: str = "axis"
    provenance: Mapping[str, Any] = field(default_factory=dict)
    estimates: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise ModelError(f"sampling period {self.dt} s: give a positive number of seconds")

    def caution(self, name: str) -> str:
        """Return why a parameter's estimate has no interval, in brackets; empty if it has one."""
        entry = self.estimates.get(name)
        status = entry.get("status") if isinstance(entry, Mapping) else None
        known = [item.value for item in UNTRUSTED if item.value == status]
        return f" ({known[0]})" if known else ""

    @cached_property
    def substeps(self) -> int:
        """Runge-Kutta steps of order four per sample, those of the package's own simulation."""
        return substeps_for(self.axis, self.dt)

    @cached_property
    def start(self) -> FloatArray:
        """State at mid-stroke and standstill with the pressures' forces balanced, shape (nx,).

        Chamber N is half-way between exhaust and supply pressure, effects are at rest; SI units.
        """
        return balanced_state(self.axis)

    @property
    def units(self) -> dict[str, dict[str, str]]:
        """SI units of ``states``, ``inputs``, ``outputs`` and ``parameters``, in order."""
        axis = self.axis
        states = {name: axis.unit(name) for name in axis.motion_states}
        for effect in axis.effects:
            states |= {f"{effect.name}.{state.name}": state.unit for state in effect.states}
        return {
            "states": states,
            "inputs": {name: axis.unit(name) for name in axis.inputs},
            "outputs": {name: axis.unit(name) for name in axis.outputs},
            "parameters": {item.name: item.unit for item in axis.parameters},
        }


def identified_model(identification: Identification) -> IdentifiedModel:
    """Return the identified model of an identification."""
    return _of_result(result_dict(identification), identification.axis)


def read_model(path: str | Path) -> IdentifiedModel:
    """Read a model from a result: its folder, `result.json`, or an exported `axis.json`.

    Nothing in the file is executed; the model is built anew from its numbers.

    Parameters
    ----------
    path : path
        Report folder of `write_report` or the command ``identify``, or a JSON file.

    Raises
    ------
    CaseError
        If there is no such file, or it holds no model.

    Examples
    --------
    With ``result = pc.identify(pc.example_case())``:

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     (file,) = pc.export_model(result, folder, "json")
    ...     model = pc.read_model(file)
    >>> model.name, model.axis.parameters.as_dict() == result.axis.parameters.as_dict()
    ('table1', True)
    """
    path = result_path(path)
    content = read_json(path, "`identify` writes result.json")
    if content.get("model") is None:
        raise CaseError(
            f"{path}: holds no `model`; give a result.json of `identify` (one of an earlier "
            "version lacks it: identify anew) or an exported axis.json"
        )
    try:
        check_format(content, FORMAT)
        if content.get("kind") != _KIND:
            result = typed(content, ResultSection)
            assert result.model is not None
            return _of_result(content, axis_of_section(result.model))
        file = typed(content, _ModelFile)
        return IdentifiedModel(
            axis_of_section(file.model),
            file.sampling.dt_s,
            file.name,
            file.provenance,
            file.estimates,
        )
    except (CaseError, ModelError) as error:
        raise CaseError(f"{path}: {error}") from None


class _Sampling(Section):
    dt_s: float


class _ModelFile(Section):
    name: str
    sampling: _Sampling
    model: AxisSection
    provenance: dict[str, Any]
    estimates: dict[str, Any]


def model_dict(model: IdentifiedModel) -> dict[str, Any]:
    """Return a model as plain values for `axis.json`; `read_model` gives it back.

    Raises
    ------
    ModelError
        If its flow map or an effect are your own, see `axis_dict`.
    """
    return {"kind": _KIND, **description(model), "model": axis_dict(model.axis)}


def write_model(model: IdentifiedModel, folder: str | Path) -> Path:
    """Write ``axis.json``; a file there is replaced.

    Parameters
    ----------
    model : IdentifiedModel
        What to write; its effects must be of the catalogue.
    folder : path
        Where the file goes; it is made if it is not there.

    Returns
    -------
    Path
        The file, which `read_model` reads.

    Raises
    ------
    ModelError
        If an effect or the flow map is your own: a file cannot hold its equations.
    """
    (path,) = write_files({"axis.json": json_text(model_dict(model))}, folder)
    return path


def description(model: IdentifiedModel) -> dict[str, Any]:
    """Return what any reader of an export needs: names, units, sampling, start, provenance."""
    axis = model.axis
    return {
        "format": FORMAT,
        "name": model.name,
        **model.units,
        "values": axis.parameters.as_dict(),
        "effects": [effect.name for effect in axis.effects],
        "start": dict(zip(axis.states, model.start.tolist(), strict=True)),
        "sampling": {
            "dt_s": model.dt,
            "runge_kutta_steps": model.substeps,
            "hold": "zero order",
        },
        "conventions": "SI units; pressures absolute; x from mid-stroke; u[k] acts from t[k] on",
        "estimates": dict(model.estimates),
        "provenance": dict(model.provenance),
    }


def require_rates(axis: Axis, what: str) -> None:
    """Refuse to write equations of continuous time for an axis whose states jump at samples.

    Raises
    ------
    ModelError
        Naming these states.
    """
    if axis.sampled_states:
        raise ModelError(
            f"{', '.join(axis.sampled_states)} jump from sample to sample, which {what} cannot "
            "hold; export in the format casadi, whose `step` holds it, or leave the effect out"
        )


def balanced_state(axis: Axis) -> FloatArray:
    """Return the state of `IdentifiedModel.start`."""
    constants, nominal = axis.constants, [0.0, 0.0]
    if axis.kind.gas_chambers:
        p_ext, p_supply = constants["p_ext"], constants["p_supply"]
        load = float(load_force({}, axis.parameters["M"].value, constants))
        half = constants["S_N"] * (p_supply - p_ext) / 2
        p_P = min(max(p_ext + (half - load) / constants["S_P"], p_ext), p_supply)
        p_N = p_ext + (constants["S_P"] * (p_P - p_ext) + load) / constants["S_N"]
        nominal = [p_P, p_N, 0.0, 0.0]
    full = axis.rest(nominal, axis.inputs_at_rest, axis.parameters.values)
    return np.asarray(full, dtype=float).ravel()


def identifier(name: str) -> str:
    """Return a name as C identifier: ``valve_lag.u_P`` gives ``valve_lag_u_P``."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def plain(text: str) -> str:
    r"""Return a text of which nothing has a meaning in C or XML: letters, digits, ``._+()[]/-``.

    A name may come from a file of somebody else, and stands in comments and strings of code that
    is compiled. Other characters become underscores, the end of a long text is left out.

    Examples
    --------
    >>> plain("axis 2 (kg/m²)"), plain("*/ int x;"), plain("??/")
    ('axis 2 (kg/m²)', '_/ int x_', '__/')
    """
    return re.sub(r"[^A-Za-z0-9⁰¹²³⁴⁵⁶⁷⁸⁹µ°·._+()\[\]/ -]", "_", text)[:80]


def _of_result(content: Mapping[str, Any], axis: Axis) -> IdentifiedModel:
    estimates = dict(content["output_error"]["parameters"])
    if content["flow"] is not None:
        estimates |= content["flow"]["parameters"]
    return IdentifiedModel(
        axis,
        1 / axis.bench.sampling_frequency,
        str(content["case"]),
        dict(content["provenance"]),
        estimates,
    )
