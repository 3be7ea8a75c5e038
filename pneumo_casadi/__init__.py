"""Identify pneumatic servo axes, and diagnose where simulation and measurement disagree.

``import pneumo_casadi as pc`` gives the names below; each is imported when it is first used, and
so are the subpackages (``pc.valve``, ``pc.virtual_bench``, ...).

Examples
--------
>>> import pneumo_casadi as pc
>>> case = pc.example_case()
>>> case.name, len(case.identify), len(case.validate)
('table1', 1, 1)
"""

__version__ = "0.2.0.dev0"

#: The public names, by the module that defines them. Classes that a user only receives, and the
#: exceptions, stay in their subpackages: ``pc.errors.CaseError``, ``pc.diagnosis.Verdict``.
_SOURCES = {
    "data": ("Case", "Recording", "example_case", "read_case", "write_case"),
    "data.check": ("check",),
    "design": ("ExperimentRequest", "design_experiment"),
    "diagnosis": ("Diagnosis",),
    "diagnosis.diagnose": ("diagnose",),
    "effects": ("EFFECTS",),
    "estimation.equation_error": ("fit_equation_error",),
    "estimation.output_error": ("OutputErrorOptions", "fit_output_error"),
    "estimation.wls": ("fit_wls",),
    "export": ("export_model", "read_model"),
    "identification.compare": ("compare",),
    "identification.identify": ("identify",),
    "identification.options": ("IdentifyOptions",),
    "identification.result": ("Identification",),
    "model.effect": ("Effect",),
    "model.servosystem": ("Servosystem",),
    "model.simulation": ("simulate", "simulate_closed_loop"),
    "parameters": ("Parameter",),
    "report.pages.report": ("write_report",),
    "validation": ("validate",),
    "virtual_bench": ("make_case",),
}
_MODULE_OF = {name: module for module, names in _SOURCES.items() for name in names}
_MODULE_OF["plot"] = "report.plot"
_SUBPACKAGES = (
    "data", "design", "diagnosis", "effects", "errors", "estimation", "evaluation", "export",
    "identification", "metrics", "model", "parameters", "report", "sensitivity", "signals",
    "validation", "valve", "virtual_bench",
)  # fmt: skip

__all__ = [
    "EFFECTS",
    "Case",
    "Diagnosis",
    "Effect",
    "ExperimentRequest",
    "Identification",
    "IdentifyOptions",
    "OutputErrorOptions",
    "Parameter",
    "Recording",
    "Servosystem",
    "__version__",
    "check",
    "compare",
    "design_experiment",
    "diagnose",
    "example_case",
    "export_model",
    "fit_equation_error",
    "fit_output_error",
    "fit_wls",
    "identify",
    "make_case",
    "plot",
    "read_case",
    "read_model",
    "simulate",
    "simulate_closed_loop",
    "validate",
    "write_case",
    "write_report",
]

TYPE_CHECKING = False  # as in `typing`, whose import would take longer than all of this
if TYPE_CHECKING:
    from pneumo_casadi.data import Case, Recording, example_case, read_case, write_case
    from pneumo_casadi.data.check import check
    from pneumo_casadi.design import ExperimentRequest, design_experiment
    from pneumo_casadi.diagnosis import Diagnosis
    from pneumo_casadi.diagnosis.diagnose import diagnose
    from pneumo_casadi.effects import EFFECTS
    from pneumo_casadi.estimation.equation_error import fit_equation_error
    from pneumo_casadi.estimation.output_error import OutputErrorOptions, fit_output_error
    from pneumo_casadi.estimation.wls import fit_wls
    from pneumo_casadi.export import export_model, read_model
    from pneumo_casadi.identification.compare import compare
    from pneumo_casadi.identification.identify import identify
    from pneumo_casadi.identification.options import IdentifyOptions
    from pneumo_casadi.identification.result import Identification
    from pneumo_casadi.model.effect import Effect
    from pneumo_casadi.model.servosystem import Servosystem
    from pneumo_casadi.model.simulation import simulate, simulate_closed_loop
    from pneumo_casadi.parameters import Parameter
    from pneumo_casadi.report import plot as plot
    from pneumo_casadi.report.pages.report import write_report
    from pneumo_casadi.validation.validate import validate
    from pneumo_casadi.virtual_bench import make_case


def __getattr__(name: str) -> object:
    """Import a public name or a subpackage when it is first used."""
    from importlib import import_module

    if name in _SUBPACKAGES:
        return import_module(f"{__name__}.{name}")
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{_MODULE_OF[name]}")
    value = module if name == "plot" else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names and the subpackages, for completion in editors and shells."""
    return sorted({*__all__, *_SUBPACKAGES})
