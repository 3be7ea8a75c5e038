"""Question: does a whole diagnosis still say what the rules of selection and decision are made for.

Data: records of the virtual bench with one to three effects, two seconds held out, and catalogues
of a few effects: the cases in which a rule was first needed. `tests/diagnosis/` tests each rule by
itself; here all stages act together. `right` counts the cases in which all that is expected is
said: the verdict, the causes named and their forms, the balance and driver of a term, what acts
beside it, and the share of the gap that closes. `differences` says what is not.
"""

import argparse
import logging
import os
import tempfile
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import provenance

from pneumo_casadi.data import Case
from pneumo_casadi.diagnosis import Diagnosis, Verdict, diagnose
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.virtual_bench import make_case

FLOWS = ("leakage_P", "leakage_N", "valve_null_shift", "valve_mismatch", "pressure_sensor_bias")
TERMS = ("spring_load", "leakage_N", "elastic_load")
PLAYS = ("presliding", "elastic_load", "backlash")


@dataclass(frozen=True)
class RuleCase:
    """A record with hidden effects, a catalogue, and what is to be said.

    Parameters
    ----------
    rule : str
        What is tested, as a sentence.
    seed : int
        Of the virtual bench.
    hidden : mapping of str to str
        Effect forms of the bench and their sizes.
    catalogue : tuple of str
        Effects that the diagnosis is given.
    named : mapping of str to str
        Causes to be named, each with its form; none for the verdict `unknown`.
    term : tuple of str, optional
        Balance and driver of the term to be told.
    beside : tuple of str, optional
        Causes to be told beside the term.
    closure : float, optional
        Share of the gap to be closed at least.
    values : mapping of str to float, optional
        Parameters of the first effect named, true within a twentieth.
    duration : float, optional
        Of the record that is fitted [s].
    """

    rule: str
    seed: int
    hidden: Mapping[str, str]
    catalogue: tuple[str, ...]
    named: Mapping[str, str] = field(default_factory=dict)
    term: tuple[str, str] | None = None
    beside: tuple[str, ...] = ()
    closure: float = 0.0
    values: Mapping[str, float] = field(default_factory=dict)
    duration: float = 4.0


def same(*names: str) -> dict[str, str]:
    """Return causes that are named in the form that has their name."""
    return {name: name for name in names}


CASES = (
    RuleCase(
        "What acts while a play is crossed is found by simulation.",
        21,
        {"backlash": "medium", "presliding": "medium"},
        PLAYS,
        same("backlash", "presliding"),
        duration=2.0,
    ),
    RuleCase(
        "A drag beside a late sensor is found by simulation.",
        22,
        {"position_delay": "large", "quadratic_drag": "large"},
        ("quadratic_drag", "spring_load", "position_delay"),
        same("position_delay", "quadratic_drag"),
        duration=2.0,
    ),
    RuleCase(
        "A leak that a late sensor hides alone is found beside it.",
        22,
        {"position_delay": "large", "leakage_P": "large"},
        ("leakage_P", "leakage_N", "quadratic_drag", "stribeck", "position_delay"),
        same("position_delay", "leakage_P"),
        duration=2.0,
    ),
    RuleCase(
        "A sensor that explains all stays alone.",
        23,
        {"backlash": "large"},
        PLAYS,
        same("backlash"),
        duration=2.0,
    ),
    RuleCase(
        "An offset that settles most of the gap does not hide a load.",
        24,
        {"pressure_sensor_bias": "large", "elastic_load": "medium"},
        ("elastic_load", "spring_load", "pressure_sensor_bias"),
        same("pressure_sensor_bias", "elastic_load"),
        duration=2.0,
    ),
    RuleCase(
        "A term that does what effects do is not told: a line over x is the spring.",
        12,
        {"position_nonlinearity": "medium", "spring_load": "medium", "leakage_N": "medium"},
        TERMS,
        term=("measurement", "x"),
        beside=("leakage_N", "spring_load"),
    ),
    RuleCase(
        "Beside others a term need not explain the gap by itself.",
        12,
        {"cogging": "medium", "leakage_N": "small", "spring_load": "small"},
        TERMS,
        term=("force", "x"),
        beside=("leakage_N", "spring_load"),
        closure=0.95,
    ),
    RuleCase(
        "An elastic load with hardly any damping yields to a vibration.",
        12,
        {"vibration": "medium", "leakage_N": "medium"},
        TERMS,
        term=("force", "t"),
        beside=("leakage_N",),
    ),
    RuleCase(
        "A shifted null is no stand-in for a leak that the catalogue lacks.",
        12,
        {"leakage_P": "large"},
        tuple(name for name in FLOWS if name != "leakage_P"),
        term=("mass_flow_P", "p"),
        closure=0.9,
    ),
    RuleCase(
        "Two leaks are named although a shifted null fits better than each.",
        12,
        {"leakage_P": "large", "leakage_N": "medium"},
        FLOWS,
        same("leakage_P", "leakage_N"),
    ),
    RuleCase(
        "Late pressures that swing are not taken for a slow valve besides.",
        12,
        {"pressure_sensor_lag": "large"},
        ("pressure_sensor_lag", "pressure_sensor_second_order", "valve_dynamics", "hose"),
        {"pressure_sensor_lag": "pressure_sensor_second_order"},
        closure=0.95,
        values={"tau": 15e-3, "zeta": 0.7},
    ),
    RuleCase(
        "Bristles are named by simulations where the balances show nothing, in their form.",
        21,
        {"presliding_dahl": "small"},
        ("presliding", "presliding_dahl", "stribeck", "valve_null_shift", "flow_map_shape"),
        {"presliding": "presliding_dahl"},
        closure=0.8,
    ),
    RuleCase(
        "A dead zone of one valve is named in the form that gives each its own.",
        12,
        {"valve_dead_zone_valve_P": "medium"},
        ("valve_dead_zone", "valve_dead_zone_per_edge", "valve_dead_zone_edges", "hose"),
        {"valve_dead_zone": "valve_dead_zone_per_edge"},
        closure=0.7,
    ),
    RuleCase(
        "Sensors on tubes of two lengths are named in the form that gives each its own.",
        12,
        {"pressure_sensor_lag_uneven": "medium"},
        ("pressure_sensor_lag", "pressure_sensor_lag_per_sensor", "valve_dynamics", "hose"),
        {"pressure_sensor_lag": "pressure_sensor_lag_per_sensor"},
        closure=0.8,
    ),
    RuleCase(
        "A smooth dead zone is named in the form of other edges.",
        12,
        {"valve_dead_zone_smooth": "large"},
        ("valve_dead_zone", "valve_dead_zone_edges", "valve_null_shift", "supply_droop"),
        {"valve_dead_zone": "valve_dead_zone_edges"},
        closure=0.94,
    ),
    RuleCase(
        "A shifted null that settles is named in its form among leaks.",
        12,
        {"valve_null_shift": "large"},
        ("valve_null_shift", "valve_null_shift_warming", "leakage_P", "leakage_N"),
        {"valve_null_shift": "valve_null_shift_warming"},
        closure=0.97,
    ),
    RuleCase(
        "Beside another effect another form of a cause is found.",
        91444881684,
        {"elastic_load_measured": "medium", "valve_dynamics_first_order": "large"},
        ("elastic_load", "position_on_elastic_load", "valve_dynamics", "quadratic_drag"),
        {"valve_dynamics": "valve_dynamics", "elastic_load": "position_on_elastic_load"},
        closure=0.95,
        duration=8.0,
    ),
    RuleCase(
        "Two effects in two balances are named among rivals for each.",
        6,
        {"spring_load": "medium", "leakage_P": "medium"},
        (
            *("stribeck", "quadratic_drag", "spring_load", "pressure_friction", "leakage_P"),
            *("valve_null_shift", "valve_dead_zone", "valve_dynamics", "hose"),
        ),
        same("spring_load", "leakage_P"),
    ),
)


def recorded(case: RuleCase, folder: Path) -> Case:
    """Record the case; two seconds and what the filters take are held out."""
    made = make_case(folder, case.seed, dict(case.hidden), duration=case.duration).case
    return replace(made, validate=tuple(each.window(0.0, 2.2) for each in made.validate))


def differences(case: RuleCase, told: Diagnosis) -> list[str]:
    """Return what is said in another way than expected."""
    term, closure = told.discovered, told.gap.closure.value if told.gap.closure else 0.0
    if term is not None:
        closure = 1.0 - told.gap.with_term / told.gap.before
    said = {
        "verdict": (told.verdict, Verdict.EFFECT if case.named else Verdict.UNKNOWN),
        "named": ({effect.name: effect.form for effect in told.effects}, dict(case.named)),
        "term": (term and (term.balance, term.term.driver), case.term),
        "beside": (set(term.beside) if term else set(), set(case.beside)),
        "hint": ([name for name in case.catalogue if name in told.hint], []),
    }
    result = [f"{name}: {is_} instead of {due}" for name, (is_, due) in said.items() if is_ != due]
    if closure < case.closure:
        result.append(f"closure: {closure:.3f} below {case.closure}")
    for name, due in case.values.items() if told.effects else ():
        value = told.effects[0].parameters[name].value
        if abs(value - due) > 0.05 * due:
            result.append(f"{name}: {value:.4g} instead of {due:.4g}")
    return result


def diagnosed(case: RuleCase) -> dict[str, Any]:
    """Record and diagnose a case; return what is not as expected, and how long that took."""
    logging.disable(logging.WARNING)
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        told = diagnose(
            recorded(case, Path(folder) / "case"), {name: EFFECTS[name] for name in case.catalogue}
        )
    return {"differences": differences(case, told), "seconds": time.perf_counter() - began}


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--workers", type=int, default=2, help="cases diagnosed at once")
    parser.add_argument("--quick", action="store_true", help="two cases only")
    arguments = parser.parse_args()
    cases = CASES[:2] if arguments.quick else CASES
    told = {}
    with ProcessPoolExecutor(arguments.workers) as executor:
        for case, item in zip(cases, executor.map(diagnosed, cases), strict=True):
            told[case.rule] = {"hidden": dict(case.hidden), **item}
            print(f"{case.rule} {'; '.join(item['differences']) or 'right'}", flush=True)
    result: dict[str, Any] = {
        "cases": told,
        "right": sum(not item["differences"] for item in told.values()),
        "of": len(told),
    }
    result |= provenance.made(None, arguments.quick, "numba")
    provenance.write(arguments.json, result | {"seed": [case.seed for case in cases]})
    print(f"right {result['right']} of {result['of']}")


if __name__ == "__main__":
    main()
