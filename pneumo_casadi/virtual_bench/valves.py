"""Effects of the valves, and of what leads to and from them."""

from pneumo_casadi.virtual_bench.effect import EffectForm, Size

VALVE_DYNAMICS = EffectForm(
    "valve_dynamics",
    "coil: τ i̇ = u − i, τ = 0.2/ω; spool: s̈ = ω² (i − s) − 2 ζ ω ṡ, |ṡ| limited",
    (
        Size("omega", "1/s", (400.0, 170.0, 80.0), description="natural frequency ω"),
        Size("zeta", "1", (0.7, 0.7, 0.7), off=0.7, description="damping ratio ζ"),
        Size("rate", "V/s", (400.0, 200.0, 60.0), off=1e6, description="greatest |ṡ|"),
    ),
    note="shows at edges of the reference and at high frequencies",
    constants={"first_order": 0.0, "at_N": 1.0},
)
VALVE_DEAD_ZONE = EffectForm(
    "valve_dead_zone",
    "s = u − min(max(u, −0.45 w), 0.55 w): nothing moves within w",
    (Size("width", "V", (0.04, 0.12, 0.3), description="whole width w"),),
    note="shows around u = 0; the axis creeps up to its goal",
    constants={"below": 0.9, "above": 1.1, "smooth": 0.0, "at_N": 1.0, "turned": 0.0},
)
VALVE_NULL_SHIFT = EffectForm(
    "valve_null_shift",
    "s = u + s_0 (1 − 0.15 exp(−t/5 s)) in each valve",
    (
        Size("P", "V", (0.02, 0.06, 0.15), signed=True, description="offset s_0 of valve P"),
        Size("N", "V", (0.0, 0.01, 0.02), signed=True, description="offset s_0 of valve N"),
    ),
    note="the coefficients of the flow map take part of it, against the metered points",
    strength=("P", "N"),
)
VALVE_HYSTERESIS = EffectForm(
    "valve_hysteresis",
    "0.1 u + plays of u, half-widths (0.35, 0.8, 1.5) w/2, weights (0.2, 0.4, 0.3)",
    (Size("width", "V", (0.02, 0.06, 0.18), description="width w of the loop"),),
    note="shows at reversals of the command",
    strength=("width",),
    constants={"law": 0.0, "at_N": 1.0},
)
VALVE_MISMATCH = EffectForm(
    "valve_mismatch",
    "conductance of valve N times 1 + g at the supply edge, 1 + 0.8 g at the exhaust edge",
    (Size("gain", "1", (0.03, 0.1, 0.25), signed=True, description="g"),),
    absorbed_by=("X_s4", "X_s5", "X_s6"),
    note="trajectories show little; X_s6 disagrees with S_N/(r T)",
)
FLOW_MAP_SHAPE = EffectForm(
    "flow_map_shape",
    "opening times 1 − a (z/z_n) exp(1 − z/z_n): notched edges",
    (
        Size("notch", "1", (0.1, 0.25, 0.5), description="deepest loss of gain a"),
        Size("opening", "V", (0.3, 0.35, 0.4), off=0.3, description="where it is, z_n"),
    ),
    note="the metered map shows it; polynomials affine in u cannot follow",
    metered=True,
)
HOSE = EffectForm(
    "hose",
    "three cells of volume and inertia in turns between valve and chamber, Darcy friction",
    (
        Size("length", "m", (0.5, 1.5, 3.0), description="length"),
        Size("diameter", "m", (0.006, 0.006, 0.006), off=0.006, description="bore"),
    ),
    absorbed_by=("X_s1", "X_s4"),
    note="slow motion sees its volume alone, as a dead volume",
    constants={"at_N": 1.0},
)
SUPPLY_DROOP = EffectForm(
    "supply_droop",
    "V/(r T) ṗ_s = q_r − q_in, τ q̇_r = max(G (p_supply − p_s), 0) − q_r, τ = 20 ms",
    (
        Size("volume", "m3", (1e-3, 6e-4, 3e-4), description="reservoir"),
        Size("G", "kg/(s Pa)", (40.0, 14.0, 6.0), "q/p", description="slope of the regulator"),
    ),
    note="shows while chambers fill",
)
EXHAUST_RESTRICTION = EffectForm(
    "exhaust_restriction",
    "common volume of 50 ml before a turbulent silencer of conductance C",
    (Size("C", "m3/(s Pa)", (5.0, 2.0, 0.8), "C", description="conductance"),),
    note="shows while chambers empty and the exhaust edge is not choked",
)

FORMS = (
    VALVE_DYNAMICS,
    VALVE_DEAD_ZONE,
    VALVE_NULL_SHIFT,
    VALVE_HYSTERESIS,
    VALVE_MISMATCH,
    FLOW_MAP_SHAPE,
    HOSE,
    SUPPLY_DROOP,
    EXHAUST_RESTRICTION,
)
