"""Diagnoses made by hand: one of each verdict, and curves behind them."""

from dataclasses import replace

import numpy as np

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.diagnosis import (
    Candidate,
    Check,
    Closure,
    Condition,
    Diagnosis,
    EffectFound,
    Gap,
    Location,
    Regime,
    RegimeKind,
    Value,
    Verdict,
    Where,
)
from pneumo_casadi.diagnosis.discover.discovered import DiscoveredTerm, TermCurve
from pneumo_casadi.diagnosis.locate.evidence import Evidence
from pneumo_casadi.diagnosis.locate.regime_maps import RegimeMap
from pneumo_casadi.diagnosis.locate.unknown_inputs import UnknownInputs
from pneumo_casadi.effects.term import Term
from pneumo_casadi.model.junctions import Junction

BALANCES = ("mass_flow_P", "mass_flow_N", "force")


def _views(share_left):
    """Gaps of 10 to 15 %, of which so much is left."""
    names = {"windows": ("p_P", "p_N", "x"), "closed_loop": ("p_P", "p_N", "x")}
    return {
        view: {
            name: {"before": 10.0 + 2.5 * i, "after": (10.0 + 2.5 * i) * share_left, "noise": 0.5}
            for i, name in enumerate(outputs)
        }
        for view, outputs in {**names, "balances": BALANCES}.items()
    }


SIZE = {"delta_F": Value(8.04, 0.075, "N"), "v_stribeck": Value(0.0553, 0.0005, "m/s")}
STRIBECK = Candidate(("stribeck",), 0.97, Closure(0.95, 0.93, 0.96), 0.9, 0.6, SIZE)
DRAG = Candidate(("quadratic_drag",), 0.02, Closure(0.2, 0.1, 0.3), 0.1, 0.04)
SILENT = Candidate(("valve_mismatch",), 0.0, None, 0.0, 0.0)
FAILED = Candidate(("hose",), 0.0, None, 0.0, 0.0, {}, "no step was found")
NOMINAL = {"X_s1": Value(3.49e-9, 4e-12, "kg/Pa"), "M": Value(16.9, 0.02, "kg")}

EFFECT = Diagnosis(
    case="press_4",
    verdict=Verdict.EFFECT,
    effects=(EffectFound("stribeck", 0.97, SIZE),),
    ranking=(STRIBECK, DRAG, SILENT, FAILED),
    where=Where(
        Location.FORCE,
        Junction.FORCE,
        (Regime(Condition(RegimeKind.STANDSTILL, upper=0.01), Location.FORCE, 0.71, 0.12, 0.001),),
        {"mass_flow_P": 0.03, "mass_flow_N": 0.05, "force": 0.92},
        (),
        {"mass_flow_P": 0.004, "mass_flow_N": 0.006, "force": 0.11},
        sizes={"stribeck": {"force": 0.105}},
    ),
    gap=Gap(12.7, 0.64, 0.5, Closure(0.95, 0.93, 0.96), _views(0.05)),
    ambiguous=(),
    experiment="",
    hint="",
    checks=(
        Check("M", 16.9, 0.01, 17.0, 0.85, "kg", True, "M = 16.9 kg, -0.6 % against the sheet."),
        Check("S_P", 8.5e-4, 1e-7, 8.24e-4, 1e-5, "m2", False, "S_P comes out +3.2 %."),
    ),
    notes=("hose: no step was found",),
    nominal=NOMINAL,
    fitted=NOMINAL | {f"stribeck.{name}": value for name, value in SIZE.items()},
    seconds=41.7,
)
AMBIGUOUS = replace(
    EFFECT,
    verdict=Verdict.AMBIGUOUS,
    ambiguous=(("stribeck",), ("presliding",)),
    ranking=(replace(STRIBECK, probability=0.55), replace(STRIBECK, names=("presliding",))),
    experiment="creep at three or more speeds",
)
#: A hose of one of its further forms, on both chambers; what is lacked is more in the other one.
HOSE = replace(
    EFFECT,
    effects=(
        EffectFound(
            "hose", 0.76, {"V": Value(1.34e-4, 3.4e-7, "m3")}, 0.86, "hose_volume",
            {"hose": 0.55, "hose_volume": 0.59},
        ),
    ),
    ranking=(replace(STRIBECK, names=("hose",)), DRAG),
    fitted=NOMINAL | {"hose_volume.V": Value(1.34e-4, 3.4e-7, "m3")},
    where=Where(
        Location.MASS_FLOW_N,
        Junction.LINE,
        (),
        {"mass_flow_P": 0.6, "mass_flow_N": 0.4, "force": 0.0},
        (),
        {"mass_flow_P": 0.069, "mass_flow_N": 0.058, "force": 0.004},
        None,
        ("hose",),
        (Location.MASS_FLOW_N, Location.MASS_FLOW_P),
        {"hose": {"mass_flow_P": 0.061, "mass_flow_N": 0.063, "force": 0.0}},
    ),
)  # fmt: skip
UNDECIDED = replace(
    EFFECT,
    undecided=(
        EffectFound(
            "valve_null_shift", 0.37, {"shift": Value(0.011, 0.002, "V")}, 0.008,
            "valve_null_shift", {}, {"piston_seal_leakage": 0.35},
        ),
    ),
)  # fmt: skip
BESIDES = replace(
    EFFECT,
    besides=tuple(
        EffectFound(name, 0.97, {"c": Value(1.0, 0.1, "1")}) for name in ("hose", "leakage_P")
    ),
)
CORRECTED = replace(
    BESIDES,
    corrections=(EffectFound("flow_map_shape", 0.9, {"c": Value(0.1, 0.02, "V")}),),
    unsupported=(EffectFound("elastic_load", 0.9, {"m_2": Value(2.0, 0.5, "kg")}),),
)
BESIDE_ABSORBED = replace(
    EFFECT,
    absorbed=("valve_mismatch",),
    checks=(
        Check("S_N", 7.7e-4, 1e-6, 7e-4, 1.6e-5, "m2", False, "S_N comes out +10 %."),
        Check("S_N/S_P", 0.94, 1e-3, 0.85, 8e-3, "1", False, "S_N/S_P comes out +10 %."),
    ),
)
NONE = replace(
    EFFECT,
    verdict=Verdict.NONE,
    effects=(),
    where=Where(Location.NONE, None, (), dict.fromkeys(BALANCES, 0.0), ()),
    gap=Gap(0.3, 0.3, 0.5, Closure(0.0, 0.0, 0.0), _views(1.0)),
    ranking=(replace(DRAG, probability=0.03), FAILED),
    fitted=NOMINAL,
)
ABSORBED = replace(
    NONE, verdict=Verdict.ABSORBED, ambiguous=(("valve_mismatch",),), ranking=(SILENT, DRAG)
)
ABSORBED_IN_N = replace(
    ABSORBED,
    where=replace(
        NONE.where,
        balance=Location.MASS_FLOW_N,
        balances=(Location.MASS_FLOW_N,),
        in_parameters=True,
    ),
)
_GRID = np.linspace(0.0, 9.6e-3, 51)
_SINE = 28.0 * np.sin(2 * np.pi * _GRID / 9.6e-3 + 0.3)
DISCOVERED = DiscoveredTerm(
    Term(
        "discovered",
        ("force",),
        "1",
        "x",
        "sine",
        {"amplitude": 28.0, "phase": 0.3, "period": 9.6e-3},
    ),
    {"amplitude": 0.2, "phase": 0.01, "period": 1e-6},
    Closure(0.94, 0.92, 0.96),
    (),
    TermCurve(_GRID, _SINE + 0.1, np.full(51, 0.5), _SINE),
)
UNKNOWN = replace(
    EFFECT,
    verdict=Verdict.UNKNOWN,
    effects=(),
    where=replace(EFFECT.where, sizes={}),
    hint="what is missing acts in force; most near standstill",
    gap=Gap(12.7, 9.1, 0.5, Closure(0.28, 0.2, 0.4), _views(0.72)),
    discovered=DISCOVERED,
)
ALL = {diagnosis.verdict: diagnosis for diagnosis in (EFFECT, AMBIGUOUS, NONE, ABSORBED, UNKNOWN)}


def evidence(K=200):
    """Curves: an unknown force that the effect explains."""
    t = np.linspace(0.0, 4.0, K)
    w = np.array([1e-6 * np.sin(t), 1e-6 * np.cos(t), 5 * np.sign(np.sin(3 * t))])
    std = np.array([[4e-7], [4e-7], [1.0]]) * np.ones(K)
    counts = np.ones((3, K), dtype=bool)
    counts[2, 40:60] = False
    std[2, 40:60] = 500.0
    inputs = UnknownInputs(
        t, w, std, np.zeros((4, K)), counts, np.array([1e-3, 1e-3, 100.0]), np.ones(3), BALANCES
    )
    edges, mean = np.linspace(-0.5, 0.5, 7), np.array([-1.0, -2, 0, 0, 2, 1])
    before = tuple(
        RegimeMap(name, unit, "force", edges, mean, np.full(6, 0.2))
        for name, unit in (("v", "m/s"), ("x", "m"), ("p_P", "Pa"))
    )
    after = tuple(replace(regime_map, mean=0.1 * mean) for regime_map in before)
    x = 0.02 * np.sin(t)
    shown = {"measured": x, "without effects": 0.9 * x, "with effects": 0.99 * x}
    curves = Curves("held_out", t, {"x": "m"}, {"x": 1e-5}, {"x": shown})
    return Evidence((inputs,), before, after, (curves,))


def with_curves():
    return replace(EFFECT, evidence=evidence(), discovered=DISCOVERED)


def three_effects():
    """A hose and two weak effects, with all that a page can hold."""
    spring = EffectFound("spring_load", 0.9, {"k": Value(5.3, 0.75, "N/m")}, 0.02)
    effects = (*HOSE.effects, EFFECT.effects[0], spring)
    names = ("hose", "stribeck", "spring_load")
    alone = [replace(STRIBECK, names=(name,), probability=0.0) for name in names]
    pairs = [replace(STRIBECK, names=(names[0], name), probability=0.0) for name in names[1:]]
    regimes = tuple(
        Regime(Condition(RegimeKind.STANDSTILL, upper=0.01 * i), Location.FORCE, 0.5, 0.1, 0.001)
        for i in range(1, 6)
    )
    curves = evidence()
    before, after = (
        tuple(replace(item, balance=balance) for balance in BALANCES for item in (*maps, *maps[:2]))
        for maps in (curves.before, curves.after)
    )
    checks = tuple(replace(EFFECT.checks[0], name=name) for name in "ABCDEFGHIJKL")
    return replace(
        HOSE,
        effects=effects,
        ranking=(replace(STRIBECK, names=names, probability=0.9), *pairs, *alone, DRAG, FAILED),
        where=replace(
            HOSE.where,
            regimes=regimes,
            balances=(*HOSE.where.balances, Location.FORCE),
            sizes=dict(HOSE.where.sizes) | {"stribeck": {"force": 0.009}},
        ),
        checks=checks,
        evidence=replace(curves, before=before, after=after),
    )
