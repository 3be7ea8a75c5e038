"""The axes that can be made: valves and a cylinder, a known force, or measured pressures."""

from collections.abc import Iterable

from pneumo_casadi.data import AnyBench, Bench, ForceBench, PressureBench
from pneumo_casadi.errors import ModelError
from pneumo_casadi.model.axis import V_S_SHARP, Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.parameters import Parameter, Parameters
from pneumo_casadi.valve import AnyFlowModel

#: Width of the smoothed sign of the velocity at which a model starts [m/s].
V_S = 1e-3


def Servosystem(bench: Bench, flow: AnyFlowModel, effects: Iterable[Effect] = ()) -> Axis:
    """Make the two-valve pneumatic axis of eq. 1-4; a function that returns an `Axis`.

    Its chamber parameters are X_s1 = V_P(0)/(k_P r T), X_s2 = S_P/(k_P r T), X_s3 = S_P/(r T), and
    X_s4 ... X_s6 the same of chamber N.

    Parameters
    ----------
    bench : Bench
        Geometry, pressures and gas.
    flow : flow model
        Static map of the valves, for example from ``fit_polynomials``; a `FlowPair` where they
        differ.
    effects : iterable of Effect, optional
        Physics to add to the nominal axis, at null values.

    Returns
    -------
    Axis
        X_s1 ... X_s6 start at values from the geometry, with k = 1.2 and a dead length of 5 % of
        the stroke at each end, and are bounded by a factor of 20 below and above. M starts at the
        data sheet value, or 10 kg, and is bounded by a factor of 100. f_v is not negative;
        F_c_plus and F_c_minus have no bounds. v_s is fixed.

    Examples
    --------
    >>> import pneumo_casadi as pc
    >>> case = pc.example_case()
    >>> flow_map = pc.valve.read_flow_map(case.flow_map_path)
    >>> axis = pc.Servosystem(case.bench, pc.valve.fit_polynomials(flow_map, (7, 7, 4)))
    >>> axis.states
    ('p_P', 'p_N', 'x', 'v')
    """
    nominal = Parameters([*_chamber_parameters(bench), *_motion_parameters(bench)])
    axis = Axis(bench, flow, (), nominal + flow.parameters)
    return axis.with_effects(*effects)


def ForceAxis(bench: ForceBench, effects: Iterable[Effect] = ()) -> Axis:
    """Make the axis driven by a known force: the motion balance alone.

    A symmetric Coulomb friction F_c with an offset F_0 is F_c_plus = F_c + F_0 and
    F_c_minus = F_c - F_0.
    """
    return Axis(bench, None, (), Parameters(_motion_parameters(bench))).with_effects(*effects)


def PressureAxis(bench: PressureBench, effects: Iterable[Effect] = ()) -> Axis:
    """Make the moving mass alone, driven by the measured pressures of its chambers.

    The piston areas ``S_P`` and ``S_N`` are parameters: free where a force on the rod is
    recorded (``F_load``), which gives all forces their scale; held at the bench's values
    otherwise, because a common factor of areas, mass and friction changes no motion.
    """
    measured = "F_load" in bench.signals
    areas = [
        Parameter(
            f"S_{chamber}",
            getattr(bench, f"S_{chamber}"),
            "m2",
            lower=getattr(bench, f"S_{chamber}") / 20,
            upper=getattr(bench, f"S_{chamber}") * 20,
            free=measured,
            description=f"piston area of chamber {chamber}",
            source="eq. 1",
        )
        for chamber in bench.kind.chambers
    ]
    nominal = Parameters([*areas, *_motion_parameters(bench)])
    return Axis(bench, None, (), nominal).with_effects(*effects)


def nominal_axis(
    bench: AnyBench, flow: AnyFlowModel | None, effects: Iterable[Effect] = ()
) -> Axis:
    """Make the axis of the kind that its bench says.

    Parameters
    ----------
    bench : Bench, ForceBench or PressureBench
        Geometry and constants.
    flow : flow model or None
        Static map of the valves where this kind of axis has valves.
    effects : iterable of Effect, optional
        Physics to add to the nominal axis, at null values.

    Raises
    ------
    ModelError
        If a flow map is missing, or there are no valves to which it could belong.
    """
    if isinstance(bench, Bench) and flow is not None:
        return Servosystem(bench, flow, effects)
    if isinstance(bench, ForceBench) and flow is None:
        return ForceAxis(bench, effects)
    if isinstance(bench, PressureBench) and flow is None:
        return PressureAxis(bench, effects)
    verb = "needs the" if bench.kind.needs_flow_map else "has no"
    raise ModelError(f"a {bench.kind.title} {verb} static flow map of its valves")


def _chamber_parameters(bench: Bench) -> list[Parameter]:
    rT = bench.r * bench.T
    length = 1.1 * bench.stroke / 2
    parameters = []
    for chamber, S, first in (("P", bench.S_P, 1), ("N", bench.S_N, 4)):
        guesses = (S * length / (1.2 * rT), S / (1.2 * rT), S / rT)
        rT_k = f"(k_{chamber} r T)"
        texts = (f"V_{chamber}(0)/{rT_k}", f"S_{chamber}/{rT_k}", f"S_{chamber}/(r T)")
        units = ("kg/Pa", "kg/(Pa m)", "kg/(Pa m)")
        for offset, (guess, text, unit) in enumerate(zip(guesses, texts, units, strict=True)):
            parameters.append(
                Parameter(
                    f"X_s{first + offset}",
                    guess,
                    unit,
                    lower=guess / 20,
                    upper=guess * 20,
                    description=text,
                    source="eq. 10" if chamber == "P" else "eq. 11",
                )
            )
    return parameters


def _motion_parameters(bench: AnyBench) -> list[Parameter]:
    M = bench.datasheet.get("M_kg", 10.0)
    return [
        Parameter("M", M, "kg", lower=M / 100, upper=M * 100, description="moving mass"),
        Parameter("f_v", 20.0, "N s/m", lower=0.0, description="viscous friction", source="eq. 4"),
        Parameter("F_c_plus", 15.0, "N", description="Coulomb friction forward", source="eq. 4"),
        Parameter("F_c_minus", 15.0, "N", description="Coulomb friction backward", source="eq. 4"),
        Parameter(
            "v_s",
            V_S,
            "m/s",
            lower=V_S_SHARP,
            upper=1.0,
            free=False,
            description="width of the smoothed sign of the velocity, tanh(ẋ/v_s)",
        ),
    ]
