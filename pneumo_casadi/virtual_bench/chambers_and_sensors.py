"""Effects of the gas in the chambers and of the sensors."""

from pneumo_casadi.virtual_bench.effect import EffectForm, Size

PISTON_SEAL_LEAKAGE = EffectForm(
    "piston_seal_leakage",
    "½ q (√(1 + 8 z) − 1), z = (p_P² − p_N²)/(p_supply² − p_ext²): viscous and inertial gap",
    (Size("q", "kg/s", (0.03, 0.1, 0.3), "q", description="flow, supply against ambient"),),
    note="shows with Δp across the piston",
    strength=("q",),
    constants={"orifice": 0.0},
)
LEAKAGE_P, LEAKAGE_N = (
    EffectForm(
        f"leakage_{chamber}",
        f"q (p_{chamber}² − p_ext²)/(p_supply² − p_ext²): viscous flow through a gap",
        (Size("q", "kg/s", (0.03, 0.1, 0.25), "q", description="flow at supply pressure"),),
        note="the leakage polynomial φ takes part of it, for both chambers alike",
        strength=("q",),
        constants={"orifice": 0.0},
    )
    for chamber in "PN"
)
HEAT_TRANSFER = EffectForm(
    "heat_transfer",
    "mass and energy of each chamber; wall conductance ∝ wetted area · √p",
    (
        Size(
            "tau",
            "s",
            (0.03, 0.08, 0.25),
            description="time constant at mid-stroke, 0.6 p_supply, constant volume",
        ),
    ),
    absorbed_by=("X_s1", "X_s2", "X_s4", "X_s5"),
    note="very fast exchange is isothermal and very slow adiabatic: a polytropic index has both",
    constants={"wall": 0.0, "forced": 0.0},
)
PRESSURE_SENSOR_LAG = EffectForm(
    "pressure_sensor_lag",
    "second order, 2 ζ/ω = τ, ζ = 0.7, both sensors",
    (Size("tau", "s", (1e-3, 4e-3, 1.5e-2), description="delay of a slow signal τ"),),
    note="shows where pressures change fast",
    strength=("tau",),
    time_constant="tau",
    constants={"first_order": 0.0, "at_N": 1.0},
)
PRESSURE_SENSOR_BIAS = EffectForm(
    "pressure_sensor_bias",
    "p + b",
    (
        Size("P", "Pa", (2e3, 8e3, 2.5e4), signed=True, description="b of chamber P"),
        Size("N", "Pa", (1e3, 4e3, 1.2e4), signed=True, description="b of chamber N"),
    ),
    absorbed_by=("F_c_plus", "F_c_minus"),
    note="acts as a constant force S_P b_P − S_N b_N and a little on the flows",
    strength=("P", "N"),
)
POSITION_DELAY = EffectForm(
    "position_delay",
    "x(t − T) exactly",
    (Size("T", "s", (1e-3, 4e-3, 1.2e-2), description="delay"),),
    note="small ones drown in the position noise",
    strength=("T",),
)
BACKLASH = EffectForm(
    "backlash",
    "play between piston and position sensor, whose carriage stays where it is left",
    (Size("gap", "m", (1e-4, 4e-4, 1.5e-3), description="from contact to contact"),),
    note="shows at reversals",
    strength=("gap",),
)
COGGING = EffectForm(
    "cogging",
    "A sin(2π x/λ)",
    (
        Size("A", "N", (0.15, 0.4, 0.9), "F_c", description="amplitude"),
        Size("pitch", "m", (0.04, 0.04, 0.04), off=0.04, description="pitch λ"),
    ),
    listed=False,
    note="force over position that repeats",
    driver="x",
)
VIBRATION = EffectForm(
    "vibration",
    "A sin(2π f t)",
    (
        Size("A", "N", (0.3, 1.0, 2.5), "F_c", description="amplitude"),
        Size("f", "Hz", (6.0, 6.0, 6.0), off=6.0, description="frequency"),
    ),
    listed=False,
    note="force over time, whatever the axis does",
    driver="t",
)
SUPPLY_PULSATION = EffectForm(
    "supply_pulsation",
    "p_supply (1 + a sin(2π f t))",
    (
        Size("share", "1", (0.01, 0.03, 0.08), description="amplitude a"),
        Size("f", "Hz", (3.0, 3.0, 3.0), off=3.0, description="frequency"),
    ),
    listed=False,
    note="a compressor in the supply",
    driver="t",
)
POSITION_NONLINEARITY = EffectForm(
    "position_nonlinearity",
    "x + A sin(2π x/λ)",
    (
        Size("A", "m", (5e-5, 2e-4, 8e-4), description="amplitude"),
        Size("pitch", "m", (0.05, 0.05, 0.05), off=0.05, description="pitch λ"),
    ),
    listed=False,
    note="a sensor error over position",
    driver="x",
)
FLOW_DRIFT = EffectForm(
    "flow_drift",
    "all valve flows times 1 + a (t/τ)/(1 + t/τ), t > 0",
    (
        Size("share", "1", (0.02, 0.06, 0.15), signed=True, description="final change a"),
        Size("tau", "s", (8.0, 8.0, 8.0), off=8.0, description="time τ of half the change"),
    ),
    absorbed_by=("X_s1", "X_s2", "X_s3", "X_s4", "X_s5", "X_s6"),
    listed=False,
    note="valves that warm up; its mean is a flow scale",
    driver="t",
)
PRESSURE_CROSSTALK = EffectForm(
    "pressure_crosstalk",
    "each sensor shows a share of the other's pressure",
    (Size("share", "1", (0.003, 0.01, 0.03), description="share"),),
    listed=False,
    note="earth loop between the two transducers",
    driver="p",
)
MAGNETIC_LATCH = EffectForm(
    "magnetic_latch",
    "A exp(−(l/2 − x)/d), in +x",
    (
        Size("A", "N", (1.0, 2.5, 6.0), "F_c", description="force at the end of the stroke A"),
        Size("reach", "m", (0.15, 0.15, 0.15), "l", off=0.06, description="decay length d"),
    ),
    listed=False,
    note="a magnet, or a soft stop that pulls, near one end",
    driver="x",
)
PERIODIC_LEAK = EffectForm(
    "periodic_leak",
    "leak of chamber P, q (1 + sin(2π x/λ))/2 · (p_P² − p_ext²)/(p_supply² − p_ext²)",
    (
        Size("q", "kg/s", (0.03, 0.1, 0.25), "q", description="flow at supply pressure"),
        Size("pitch", "m", (0.06, 0.06, 0.06), off=0.06, description="pitch λ"),
    ),
    listed=False,
    note="a barrel that is scored along its length",
    driver="x",
)
SQUARE_ROOT_FRICTION = EffectForm(
    "square_root_friction",
    "A √(|v|/1 m/s) sign v",
    (Size("A", "N", (0.5, 1.5, 4.0), "F_c", description="force at 1 m/s"),),
    absorbed_by=("f_v", "F_c_plus", "F_c_minus"),
    listed=False,
    note="a lubrication film between mixed and full",
    driver="v",
)
FRICTION_FADE = EffectForm(
    "friction_fade",
    "ΔF exp(−t/τ) sign v, t > 0",
    (
        Size("delta_F", "N", (0.15, 0.5, 1.2), "F_c", description="extra friction at the start"),
        Size("tau", "s", (6.0, 6.0, 6.0), off=6.0, description="time of the decay τ"),
    ),
    listed=False,
    note="grease that warms up",
    driver="t",
)

FORMS = (
    PISTON_SEAL_LEAKAGE,
    LEAKAGE_P,
    LEAKAGE_N,
    HEAT_TRANSFER,
    PRESSURE_SENSOR_LAG,
    PRESSURE_SENSOR_BIAS,
    POSITION_DELAY,
    BACKLASH,
)
UNLISTED = (
    COGGING,
    VIBRATION,
    SUPPLY_PULSATION,
    POSITION_NONLINEARITY,
    FLOW_DRIFT,
    PRESSURE_CROSSTALK,
    MAGNETIC_LATCH,
    PERIODIC_LEAK,
    SQUARE_ROOT_FRICTION,
    FRICTION_FADE,
)
