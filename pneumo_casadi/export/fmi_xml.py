"""The two XML files of an FMU: model description and build description (FMI 3.0)."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import casadi as ca

from pneumo_casadi import __version__
from pneumo_casadi.export.c_code import NAME
from pneumo_casadi.export.model import IdentifiedModel, plain
from pneumo_casadi.runtime.input_files import printable

#: Exponents of the SI base units, in the attributes' names.
_BASE: dict[str, dict[str, int]] = {
    "1": {},
    **{unit: {unit: 1} for unit in ("kg", "m", "s", "A", "K")},
    "Hz": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
}
_POWERS = str.maketrans("²³", "23")


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of the FMU; its value reference is its place in `variables`."""

    name: str
    unit: str
    causality: str
    variability: str = "continuous"
    initial: str | None = None
    start: float | None = None
    derivative: int | None = None
    description: str = ""


def variables(model: IdentifiedModel) -> list[Variable]:
    """Return all variables in the order of their value references, as in ``fmi3.c``."""
    axis, units, nm = model.axis, model.units, len(model.axis.motion_states)
    items = [Variable("time", "s", "independent")]
    at_rest = axis.inputs_at_rest.tolist()
    items += [
        Variable(name, unit, "input", start=value)
        for (name, unit), value in zip(units["inputs"].items(), at_rest, strict=True)
    ]
    items += [
        Variable(n, unit, "output", initial="calculated", description="what the sensor shows")
        for n, unit in units["outputs"].items()
    ]
    first = len(items)
    for i, (name, unit) in enumerate(units["states"].items()):
        # The states of effects start at rest unless they are given.
        initial = "exact" if i < nm else "approx"
        start = float(model.start[i])
        items.append(Variable(f"state.{name}", unit, "local", initial=initial, start=start))
    for i, (name, unit) in enumerate(units["states"].items()):
        items.append(
            Variable(
                f"der(state.{name})",
                rate_unit(unit),
                "local",
                initial="calculated",
                derivative=first + i,
            )
        )
    items += [
        Variable(
            item.name,
            item.unit,
            "parameter",
            "tunable",
            "exact",
            item.value,
            None,
            f"{item.description}{model.caution(item.name)}",
        )
        for item in axis.parameters
    ]
    return items


def model_description(model: IdentifiedModel, token: str) -> str:
    """Return ``modelDescription.xml``."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=plain(model.name),
        instantiationToken=token,
        description="Pneumatic servo axis with identified parameters",
        generationTool=f"pneumo_casadi {__version__}",
        variableNamingConvention="structured",
    )
    shared = {
        "modelIdentifier": NAME,
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
    }
    ET.SubElement(root, "ModelExchange", shared)
    ET.SubElement(root, "CoSimulation", shared | {"canHandleVariableCommunicationStepSize": "true"})
    items = variables(model)
    _units(root, sorted({item.unit for item in items}))
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(model.dt))
    listed = ET.SubElement(root, "ModelVariables")
    for reference, item in enumerate(items):
        ET.SubElement(listed, "Float64", _attributes(item, reference))
    _structure(root, model, items)
    return _text(root)


def build_description(sources: Sequence[str]) -> str:
    """Return ``sources/buildDescription.xml``."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=NAME)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in sources:
        ET.SubElement(files, "SourceFile", name=name)
    ET.SubElement(configuration, "Library", name="m", external="true")
    return _text(root)


def rate_unit(unit: str) -> str:
    """Return the unit of a rate.

    Examples
    --------
    >>> [rate_unit(unit) for unit in ("Pa", "m/s", "1", "kg/(m s)")]
    ['Pa/s', 'm/s2', '1/s', 'kg/(m s s)']
    """
    if unit.endswith("/s"):
        return f"{unit}2"
    head, slash, tail = unit.partition("/")
    return f"{head}/({tail.strip('()')} s)" if slash else f"{unit}/s"


def base_units(unit: str) -> dict[str, int] | None:
    """Return the exponents of the SI base units, None where a unit is unknown.

    Examples
    --------
    >>> base_units("kg/(Pa m)")
    {'s': 2}
    >>> base_units("furlong") is None
    True
    """
    total: dict[str, int] = {}
    above, _, below = unit.translate(_POWERS).partition("/")
    for part, sign in ((above, 1), (below.strip("()"), -1)):
        for factor in part.split():
            match = re.fullmatch(r"([A-Za-z]+|1)(\d*)", factor)
            if match is None or match[1] not in _BASE:
                return None
            for base, exponent in _BASE[match[1]].items():
                total[base] = total.get(base, 0) + sign * exponent * int(match[2] or 1)
    return {base: exponent for base, exponent in total.items() if exponent}


def _units(root: ET.Element, names: Sequence[str]) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name in names:
        unit = ET.SubElement(definitions, "Unit", name=name)
        base = base_units(name)
        if base is not None:
            ET.SubElement(unit, "BaseUnit", {key: str(value) for key, value in base.items()})


def _attributes(item: Variable, reference: int) -> dict[str, str]:
    required = {
        "name": printable(item.name),
        "valueReference": str(reference),
        "causality": item.causality,
        "variability": item.variability,
        "unit": item.unit,
    }
    optional = {
        "initial": item.initial,
        "start": None if item.start is None else repr(item.start),
        "derivative": None if item.derivative is None else str(item.derivative),
        "description": printable(item.description) or None,
    }
    return required | {key: value for key, value in optional.items() if value is not None}


def _structure(root: ET.Element, model: IdentifiedModel, items: Sequence[Variable]) -> None:
    structure = ET.SubElement(root, "ModelStructure")
    references = {item.name: i for i, item in enumerate(items)}
    for tag, f, names in (
        ("Output", model.axis.output, model.axis.outputs),
        ("ContinuousStateDerivative", model.axis.rhs, _derivatives(model)),
    ):
        for row, name in enumerate(names):
            # Without these an importer assumes that every output depends directly on every input.
            depends = [references[other] for other in _dependencies(model, f, row)]
            attributes = {
                "valueReference": str(references[name]),
                "dependencies": " ".join(map(str, sorted(depends))),
            }
            ET.SubElement(structure, tag, attributes)
    for reference, item in enumerate(items):
        if item.initial in ("calculated", "approx"):
            ET.SubElement(structure, "InitialUnknown", valueReference=str(reference))


def _derivatives(model: IdentifiedModel) -> list[str]:
    return [f"der(state.{name})" for name in model.axis.states]


def _dependencies(model: IdentifiedModel, f: ca.Function, row: int) -> Iterator[str]:
    """Yield the states and inputs on which an element of f(x, u, θ) depends."""
    names = ([f"state.{name}" for name in model.axis.states], model.axis.inputs)
    for argument, known in enumerate(names):
        pattern = f.jac_sparsity(0, argument)
        columns = zip(*pattern.get_triplet(), strict=True)
        yield from (known[column] for at, column in columns if at == row)


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'
