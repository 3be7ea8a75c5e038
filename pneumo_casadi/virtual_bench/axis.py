"""The axis on the bench: geometry, gas, friction, valve, sensors, controller; random ones too."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.data import (
    Bench,
    CascadeController,
    Load,
    PidController,
    ProportionalController,
    SensorNoise,
)


@dataclass(frozen=True, slots=True)
class VirtualValve:
    """A three-way spool valve: supply edge and exhaust edge after ISO 6358.

    Parameters
    ----------
    k_supply, k_exhaust : float
        Sonic conductance per opening [m³/(s Pa V)].
    lap_supply, lap_exhaust : float
        Command at which the edge opens [V]; positive: overlap, negative: underlap.
    clearance : float
        Radial clearance, as an opening [V].
    closing : float
        How fast the clearance closes along the overlap [1].
    leak_supply, leak_exhaust : float
        Conductance that stays however far the edge is closed [m³/(s Pa)].
    b_supply, b_exhaust, m_supply, m_exhaust : float
        Critical pressure ratio and subsonic index [1].
    """

    k_supply: float
    k_exhaust: float
    lap_supply: float = 0.0
    lap_exhaust: float = 0.0
    clearance: float = 0.0
    closing: float = 1.0
    leak_supply: float = 0.0
    leak_exhaust: float = 0.0
    b_supply: float = 0.3
    b_exhaust: float = 0.3
    m_supply: float = 0.5
    m_exhaust: float = 0.5


@dataclass(frozen=True, slots=True)
class VirtualSensors:
    """Sensors and converters.

    Parameters
    ----------
    p_noise, x_noise : float
        Standard deviations [Pa, m].
    p_quantum, x_quantum, u_quantum : float
        Steps of the converters [Pa, m, V]; 0 for none.
    bandwidth : float
        Corner of the anti-alias filters, two equal lags a channel [Hz]; 0 for none.
    """

    p_noise: float = 150.0
    x_noise: float = 1.5e-5
    p_quantum: float = 15.0
    x_quantum: float = 5e-6
    u_quantum: float = 6e-4
    bandwidth: float = 8000.0


#: Sensors that show the state itself: for balances and convergence.
IDEAL_SENSORS = VirtualSensors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class VirtualAxis:
    """All that the bench knows of an axis without hidden effects.

    Parameters
    ----------
    M : float
        Moving mass [kg].
    S_P, S_N : float
        Piston areas [m²].
    stroke : float
        [m]; x = 0 is the middle.
    V_DP, V_DN : float
        Dead volumes [m³].
    k_P, k_N : float
        Polytropic indices [1].
    f_v : float
        Viscous friction [N s/m].
    F_c_plus, F_c_minus : float
        Coulomb friction against motion up and down [N].
    valve : VirtualValve
        Both valves are alike.
    gain : float
        Of the proportional controller [V/m].
    p_supply, p_ext : float
        Absolute pressures [Pa].
    T, r : float
        Temperature [K] and gas constant [J/(kg K)].
    u_max : float
        Largest command [V].
    sensors : VirtualSensors
        Sensors and converters.
    angle_deg : float
        Inclination of +x above the horizontal [°].
    controller : PidController or CascadeController, optional
        In place of the proportional one.
    """

    M: float
    S_P: float
    S_N: float
    stroke: float
    V_DP: float
    V_DN: float
    k_P: float
    k_N: float
    f_v: float
    F_c_plus: float
    F_c_minus: float
    valve: VirtualValve
    gain: float
    p_supply: float
    p_ext: float = 1e5
    T: float = 293.15
    r: float = 287.0
    u_max: float = 5.0
    sensors: VirtualSensors = VirtualSensors()
    angle_deg: float = 0.0
    controller: PidController | CascadeController | None = None

    @property
    def V_P0(self) -> float:
        """Volume of chamber P at mid-stroke [m³] (eq. 3)."""
        return self.V_DP + self.S_P * self.stroke / 2

    @property
    def V_N0(self) -> float:
        """Volume of chamber N at mid-stroke [m³] (eq. 3)."""
        return self.V_DN + self.S_N * self.stroke / 2

    @property
    def truth(self) -> Mapping[str, float]:
        """Parameters of eq. 9 to 11 that the polytropic axis has [SI]."""
        rT = self.r * self.T
        return {
            "X_s1": self.V_P0 / (self.k_P * rT),
            "X_s2": self.S_P / (self.k_P * rT),
            "X_s3": self.S_P / rT,
            "X_s4": self.V_N0 / (self.k_N * rT),
            "X_s5": self.S_N / (self.k_N * rT),
            "X_s6": self.S_N / rT,
            "M": self.M,
            "f_v": self.f_v,
            "F_c_plus": self.F_c_plus,
            "F_c_minus": self.F_c_minus,
        }

    def with_ideal_sensors(self) -> "VirtualAxis":
        """Return the axis with sensors that show its state as it is."""
        return replace(self, sensors=IDEAL_SENSORS)

    def bench_description(self, fs: float, M_datasheet: float) -> Bench:
        """Return the bench description, with values rounded as in a data sheet."""
        return Bench(
            sampling_frequency=fs,
            S_P=round(self.S_P, 9),
            S_N=round(self.S_N, 9),
            stroke=round(self.stroke, 4),
            p_ext=self.p_ext,
            p_supply=round(self.p_supply, -2),
            T=self.T,
            r=self.r,
            controller=self.controller or ProportionalController(self.gain, self.u_max),
            datasheet={"M_kg": float(f"{M_datasheet:.4g}")},
            noise=SensorNoise(self.sensors.p_noise or 1.0, self.sensors.x_noise or 1e-7),
            load=Load(self.angle_deg),
        )


def random_axis(seed: int) -> VirtualAxis:
    """Return a plausible axis: a 32 to 40 mm cylinder that moves 10 to 22 kg.

    Parameters
    ----------
    seed : int
        The same seed gives the same axis.

    Examples
    --------
    >>> axis = random_axis(1)
    >>> 10 <= axis.M <= 22, axis == random_axis(1), axis == random_axis(2)
    (True, True, False)
    """
    rng = np.random.default_rng([seed, 1])

    def draw(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    S_P = draw(7e-4, 1.25e-3)
    S_N = S_P * draw(0.7, 0.87)
    stroke = draw(0.4, 0.53)
    k_supply = draw(2.8e-9, 3.8e-9)
    clearance = draw(0.007, 0.014)
    valve = VirtualValve(
        k_supply=k_supply,
        k_exhaust=k_supply * draw(1.15, 1.75),
        lap_supply=draw(-0.001, 0.001),
        lap_exhaust=draw(-0.001, 0.001),
        clearance=clearance,
        closing=draw(1.0, 3.0),
        leak_supply=k_supply * draw(0.03, 0.055),
        leak_exhaust=k_supply * draw(0.045, 0.08),
        b_supply=draw(0.22, 0.42),
        b_exhaust=draw(0.22, 0.42),
        m_supply=draw(0.49, 0.53),
        m_exhaust=draw(0.49, 0.53),
    )
    return VirtualAxis(
        M=draw(10.0, 22.0),
        S_P=S_P,
        S_N=S_N,
        stroke=stroke,
        V_DP=S_P * stroke / 2 * draw(0.08, 0.4),
        V_DN=S_N * stroke / 2 * draw(0.08, 0.4),
        k_P=draw(1.02, 1.25),
        k_N=draw(1.02, 1.25),
        f_v=draw(15.0, 42.0),
        F_c_plus=draw(8.0, 23.0),
        F_c_minus=draw(12.0, 29.0),
        valve=valve,
        gain=draw(8.5e-6, 1.4e-5) * S_P / k_supply,  # of the loop: conductance by area and way
        p_supply=draw(6.2e5, 7.6e5),
    )
