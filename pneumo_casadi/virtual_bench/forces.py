"""Effects in the balance of forces."""

from pneumo_casadi.virtual_bench.effect import EffectForm, Size

STRIBECK = EffectForm(
    "stribeck",
    "ΔF exp(−(|v|/v_s)^δ) sign v, set-valued; δ = 1 (Tustin)",
    (
        Size("delta_F", "N", (0.15, 0.4, 0.9), "F_c", description="breakaway over sliding"),
        Size("v_s", "m/s", (0.02, 0.02, 0.03), description="velocity of decay"),
        Size("exponent", "1", (1.0, 1.0, 1.0), off=1.0, fixed=True, description="δ"),
    ),
    note="shows at low speed; takes some of F_c and f_v with it",
    strength=("delta_F",),
    constants={"rational": 0.0},
)
PRESLIDING = EffectForm(
    "presliding",
    "four elasto-plastic bristles in parallel (Iwan), mean slip distance s_0, damped at creep",
    (Size("distance", "m", (4e-5, 2e-4, 6e-4), description="mean slip distance s_0"),),
    note="shows within s_0 of a reversal; small ones drown in the position noise",
    step=5e-5,
    constants={"dahl": 0.0},
)
PRESSURE_FRICTION = EffectForm(
    "pressure_friction",
    "F ((p_P + p_N − 2 p_ext)/(2 (p_supply − p_ext)))^0.9 sign v",
    (Size("F", "N", (0.4, 1.0, 2.2), "F_c", description="extra friction at supply pressure"),),
    absorbed_by=("F_c_plus", "F_c_minus"),
    note="at constant mean pressure it is Coulomb friction",
    strength=("F",),
    constants={"seal": 0.0},
)
POSITION_FRICTION = EffectForm(
    "position_friction",
    "(c x + ΔF (1 + cos(π(x − x_t)/(2 w)))/2) sign v within 2 w of x_t",
    (
        Size("slope", "N/m", (0.3, 1.0, 2.5), "F_c/l", signed=True, description="c"),
        Size("height", "N", (0.15, 0.5, 1.2), "F_c", description="ΔF of the tight spot"),
        Size("centre", "m", (0.06, 0.06, 0.06), "l", signed=True, description="x_t"),
        Size("width", "m", (0.05, 0.05, 0.05), "l", off=0.05, description="half-width w"),
    ),
    note="shows where the axis passes the tight spot",
    strength=("slope", "height"),
)
QUADRATIC_DRAG = EffectForm(
    "quadratic_drag",
    "c |v|^1.8 sign v",
    (Size("c", "N s^1.8/m^1.8", (15.0, 45.0, 130.0), description="c"),),
    absorbed_by=("f_v",),
    note="at one speed it is viscous friction",
    strength=("c",),
    constants={"power": 0.8, "backward": 1.0},
)
CONSTANT_FORCE = EffectForm(
    "constant_force",
    "F_0, in +x",
    (Size("F_0", "N", (0.1, 0.4, 0.9), "F_c", signed=True, description="load"),),
    absorbed_by=("F_c_plus", "F_c_minus"),
    note="wholly absorbed by F_c⁺ − F_c⁻ while the axis moves",
)
SPRING_LOAD = EffectForm(
    "spring_load",
    "−k x (1 + ½ (2x/l)²)",
    (Size("k", "N/m", (2.0, 6.0, 14.0), "F_c/l", description="stiffness at mid-stroke"),),
    note="shows in slow, long motion",
    strength=("k",),
    constants={"hardening": 0.5, "one_sided": 0.0},
)
ELASTIC_LOAD = EffectForm(
    "elastic_load",
    "m_2 ẍ_2 = −m_2 ω² (x_2 − x) − 2 m_2 ζ ω (ẋ_2 − ẋ); M − m_2 moves with the piston",
    (
        Size("m_2", "kg", (0.15, 0.35, 0.5), "M", description="mass beyond the joint, of M"),
        Size("f", "Hz", (25.0, 12.0, 7.0), description="its frequency, piston held"),
        Size("zeta", "1", (0.05, 0.05, 0.05), description="its damping ratio"),
    ),
    absorbed_by=("M",),
    note="stiff joints move the mass as one",
    constants={"measured": 0.0, "hardening": 0.0},
)

FORMS = (
    STRIBECK,
    PRESLIDING,
    PRESSURE_FRICTION,
    POSITION_FRICTION,
    QUADRATIC_DRAG,
    CONSTANT_FORCE,
    SPRING_LOAD,
    ELASTIC_LOAD,
)
