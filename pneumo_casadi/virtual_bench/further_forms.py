"""Further forms of the effects of the virtual bench: the same cause, another equation.

Nature keeps no catalogue: a diagnosis must name a cause in any of these forms.
"""

from dataclasses import replace

from pneumo_casadi.virtual_bench.chambers_and_sensors import (
    BACKLASH,
    HEAT_TRANSFER,
    LEAKAGE_N,
    LEAKAGE_P,
    PISTON_SEAL_LEAKAGE,
    PRESSURE_SENSOR_LAG,
)
from pneumo_casadi.virtual_bench.effect import EffectForm, Size
from pneumo_casadi.virtual_bench.forces import (
    ELASTIC_LOAD,
    POSITION_FRICTION,
    PRESLIDING,
    PRESSURE_FRICTION,
    QUADRATIC_DRAG,
    SPRING_LOAD,
    STRIBECK,
)
from pneumo_casadi.virtual_bench.valves import (
    FLOW_MAP_SHAPE,
    HOSE,
    VALVE_DEAD_ZONE,
    VALVE_DYNAMICS,
    VALVE_HYSTERESIS,
)


def _form(usual: EffectForm, name: str, equation: str, **constants: float) -> EffectForm:
    """Return a form that differs from the usual one of its cause by constants of the kernels."""
    return replace(
        usual,
        name=f"{usual.name}_{name}",
        equation=equation,
        cause=usual.name,
        constants={**usual.constants, **constants},
    )


def _with_exponent(exponent: float) -> tuple[Size, ...]:
    delta_F, v_s, _ = STRIBECK.sizes
    return (
        delta_F,
        v_s,
        Size("exponent", "1", (exponent,) * 3, off=1.0, fixed=True, description="δ"),
    )


_HOSE_SIZES = (
    Size("V", "m3", (2.5e-5, 6e-5, 1.4e-4), description="volume at the valve"),
    Size("C", "m3/(s Pa)", (2.5, 1.8, 1.2), "C", off=6e-9, description="conductance"),
)
_HOSE_EQUATION = "V/(r T) ṗ_h = q_valve(u, p_h) − q_h, q_h of ISO 6358 between p_h and p; {} shown"

_TWO_MASSES = EffectForm(
    "backlash_two_masses",
    "m_2 ẍ_2 = max(m_2 ω² (δ − b/2) + 2 m_2 ζ ω δ̇, 0) for δ = x − x_2 > b/2, likewise backward",
    (
        Size("gap", "m", (5e-4, 1.5e-3, 4e-3), description="b, from contact to contact"),
        Size("m_2", "kg", (0.3, 0.3, 0.3), "M", description="mass beyond the play, of M"),
        Size("f", "Hz", (40.0, 40.0, 40.0), description="its frequency in contact"),
        Size("zeta", "1", (0.15, 0.15, 0.15), description="its damping ratio in contact"),
    ),
    note="the load is missing while it crosses the play",
    cause=BACKLASH.name,
    kernel="coupling",
    constants={"measured": 0.0},
    strength=("gap", "m_2"),  # a contact without a play is still an elastic joint
)

FORMS = (
    _TWO_MASSES,
    replace(
        _TWO_MASSES,
        name="backlash_two_masses_measured",
        equation="as backlash_two_masses; the position sensor is at x_2",
        constants={"measured": 1.0},
    ),
    replace(
        _form(STRIBECK, "gaussian", "ΔF exp(−(v/v_s)²) sign v, set-valued"),
        sizes=_with_exponent(2.0),
    ),
    _form(STRIBECK, "rational", "ΔF/(1 + (v/v_s)²) sign v (Hess and Soom)", rational=1.0),
    replace(
        _form(STRIBECK, "film", "ΔF exp(−h) sign v, τ ḣ = (|v|/v_s)^(2/3) − h: the film lags"),
        sizes=(
            *STRIBECK.sizes[:2],
            Size("tau", "s", (0.03, 0.08, 0.2), description="time of the film"),
        ),
        time_constant="tau",
    ),
    _form(PRESLIDING, "dahl", "dF/dx = (F_c/s_0)(1 − (F/F_c) sign v) (Dahl 1976)", dahl=1.0),
    _form(
        PRESSURE_FRICTION, "rod", "F (p_N − p_ext)/(p_supply − p_ext) sign v: rod seal", seal=1.0
    ),
    _form(
        PRESSURE_FRICTION,
        "piston",
        "F |p_P − p_N|/(p_supply − p_ext) sign v: the lip under pressure of the piston seal",
        seal=2.0,
    ),
    replace(
        _form(POSITION_FRICTION, "vee", "k |x − x_0| sign v"),
        kernel="position_friction_vee",
        sizes=(
            Size("k", "N/m", (0.7, 2.2, 6.0), "F_c/l", description="slope to both sides"),
            Size("centre", "m", (0.08, 0.08, 0.08), "l", signed=True, description="x_0"),
        ),
        strength=("k",),
    ),
    replace(
        _form(POSITION_FRICTION, "step", "ΔF (1 + tanh((x − x_0)/w))/2 sign v"),
        kernel="position_friction_step",
        sizes=(
            Size("height", "N", (0.15, 0.5, 1.2), "F_c", description="ΔF beyond the joint"),
            Size("centre", "m", (0.05, 0.05, 0.05), "l", signed=True, description="x_0"),
            Size("width", "m", (0.01, 0.01, 0.01), "l", off=0.005, description="w"),
        ),
        strength=("height",),
    ),
    replace(
        _form(QUADRATIC_DRAG, "steep", "c |v|^2.2 sign v", power=1.2),
        sizes=(replace(QUADRATIC_DRAG.sizes[0], unit="N s^2.2/m^2.2"),),
    ),
    _form(
        QUADRATIC_DRAG,
        "check_valve",
        "c |v|^1.8 sign v, a fifth of it for v < 0: a damper with a check valve",
        backward=0.2,
    ),
    _form(SPRING_LOAD, "softening", "−k x (1 − 0.3 (2x/l)²)", hardening=-0.3),
    _form(SPRING_LOAD, "one_sided", "−2 k max(x + l/40, 0): slack at first", one_sided=2.0),
    _form(ELASTIC_LOAD, "measured", "as elastic_load; the position sensor is at x_2", measured=1.0),
    _form(
        ELASTIC_LOAD,
        "hardening",
        "as elastic_load, d sinh((x_2 − x)/d) in place of x_2 − x, d = 1 mm: rubber",
        hardening=1000.0,
    ),
    EffectForm(
        "flow_map_shape_fittings",
        "critical ratio b greater than on the metering bench, by 0.6 of it at exhaust edges",
        (Size("b", "1", (0.04, 0.1, 0.2), description="at supply edges"),),
        note="shows while chambers fill at little pressure across the edge",
        cause=FLOW_MAP_SHAPE.name,
        kernel="flow_map_shape_fittings",
    ),
    _form(HOSE, "uneven", HOSE.equation + "; that of chamber N a quarter as long", at_N=0.25),
    EffectForm(
        "hose_volume",
        _HOSE_EQUATION.format("p"),
        _HOSE_SIZES,
        absorbed_by=HOSE.absorbed_by,
        note=HOSE.note,
        cause="hose",
        kernel="hose_volume",
        constants={"sensor": 0.0, "at_N": 1.0},
    ),
    EffectForm(
        "hose_volume_uneven",
        _HOSE_EQUATION.format("p") + "; V of chamber N a fifth",
        _HOSE_SIZES,
        absorbed_by=HOSE.absorbed_by,
        note=HOSE.note,
        cause="hose",
        kernel="hose_volume",
        constants={"sensor": 0.0, "at_N": 0.2},
    ),
    EffectForm(
        "hose_volume_at_valve",
        _HOSE_EQUATION.format("p_h"),
        _HOSE_SIZES,
        absorbed_by=HOSE.absorbed_by,
        note="the sensor sits at the valve: the force does not follow the pressures shown",
        cause="hose",
        kernel="hose_volume",
        constants={"sensor": 1.0, "at_N": 1.0},
    ),
    _form(
        VALVE_DEAD_ZONE,
        "uneven",
        "s = u − min(max(u, −0.25 w), 0.75 w)",
        below=0.5,
        above=1.5,
    ),
    _form(VALVE_DEAD_ZONE, "smooth", "s = u − (w/2) tanh(2u/w)", smooth=1.0),
    _form(VALVE_DEAD_ZONE, "valve_P", VALVE_DEAD_ZONE.equation + "; valve P alone", at_N=0.0),
    _form(
        VALVE_DEAD_ZONE,
        "each_edge",
        "s = u − min(max(u, −0.35 w), 0.6 w) of valve P; of valve N 0.8 w, edges turned",
        below=0.7,
        above=1.2,
        at_N=0.8,
        turned=1.0,
    ),
    _form(VALVE_HYSTERESIS, "play", "one play of half-width w/2", law=1.0),
    _form(VALVE_HYSTERESIS, "stiction", "s stays until |u − s| > w/2, then goes to u", law=2.0),
    _form(VALVE_HYSTERESIS, "valve_P", VALVE_HYSTERESIS.equation + "; valve P alone", at_N=0.0),
    _form(VALVE_DYNAMICS, "first_order", "(1.4/ω) ṡ = u − s", first_order=1.0),
    _form(
        VALVE_DYNAMICS,
        "uneven",
        "(1.4/ω) ṡ = u − s; valve N five times as fast",
        first_order=1.0,
        at_N=0.2,
    ),
    EffectForm(
        "valve_dynamics_dead_time",
        "s = u(t − T)",
        (Size("T", "s", (3e-3, 7e-3, 1.6e-2), description="dead time T"),),
        note="shows at every change of the command",
        cause=VALVE_DYNAMICS.name,
        kernel="valve_dead_time",
    ),
    _form(LEAKAGE_P, "orifice", "orifice of ISO 6358 from chamber P to ambient", orifice=1.0),
    _form(LEAKAGE_N, "orifice", "orifice of ISO 6358 from chamber N to ambient", orifice=1.0),
    _form(PISTON_SEAL_LEAKAGE, "orifice", "orifice of ISO 6358 between the chambers", orifice=1.0),
    replace(
        _form(
            PISTON_SEAL_LEAKAGE,
            "scored",
            "that of piston_seal_leakage within a of x_0, over a seal of 4 mm: a scored tube",
        ),
        sizes=(
            *PISTON_SEAL_LEAKAGE.sizes,
            Size("centre", "m", (0.08, 0.08, 0.08), "l", signed=True, description="x_0"),
            Size("half", "m", (0.1, 0.1, 0.1), "l", description="half of its length, a"),
        ),
    ),
    _form(HEAT_TRANSFER, "warm_wall", "walls of 40 J/K that the air warms up", wall=40.0),
    _form(
        HEAT_TRANSFER,
        "forced",
        HEAT_TRANSFER.equation + " · (1 + ½ (|v|/0.1)^0.75): the piston stirs the air",
        forced=0.5,
    ),
    _form(PRESSURE_SENSOR_LAG, "first_order", "τ ẏ + y = p, both sensors", first_order=1.0),
    _form(
        PRESSURE_SENSOR_LAG,
        "uneven",
        "τ ẏ + y = p, τ of chamber N a half",
        first_order=1.0,
        at_N=0.5,
    ),
)
