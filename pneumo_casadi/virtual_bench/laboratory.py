"""Situations of laboratories: what they own and record beside the bench of the paper."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pneumo_casadi.data import (
    AnyBench,
    Arrangement,
    Bench,
    CascadeController,
    Clock,
    FlowSource,
    InputHold,
    NoController,
    PidController,
    PressureBench,
    Recording,
    ValveData,
    Valves,
)
from pneumo_casadi.parameters import FloatArray
from pneumo_casadi.virtual_bench.axis import VirtualAxis
from pneumo_casadi.virtual_bench.catalogue import EffectRequest
from pneumo_casadi.virtual_bench.effect import VirtualEffect
from pneumo_casadi.virtual_bench.experiment import Excitation, Experiment
from pneumo_casadi.virtual_bench.kernels import layout
from pneumo_casadi.virtual_bench.simulation import metered_map, shown_channels, simulate_axis

#: Frequency of a measured load force [Hz], away from the references' own.
LOAD_FREQUENCY = 0.7
#: Noise of the load cell [N].
LOAD_NOISE = 0.5


@dataclass(frozen=True, slots=True)
class Laboratory:
    """What differs from two equal metered valves, a proportional controller and a steady clock.

    Parameters
    ----------
    angle_deg : float, optional
        Inclination of +x above the horizontal [°]; by default that of the axis.
    load_force : float, optional
        Amplitude of an external force that a load cell measures [N]; recorded as ``F_load``.
    supply : bool, optional
        Whether the supply pressure droops and is recorded.
    v_noise, a_noise : float, optional
        Noise of sensors of velocity [m/s] and acceleration [m/s²]; 0 where there is none.
    double_rod : bool, optional
        Whether both piston areas are equal.
    other_valve : float, optional
        Share by which the supply edge of valve N is larger, its exhaust edge by 0.8 of that.
        Where not 0, each valve has a map of its own.
    arrangement : Arrangement, optional
        One five-way valve is recorded by its one command.
    source : FlowSource, optional
        What is known of the valves.
    meter_accuracy : float, optional
        Standard uncertainty that is stated of the flow meter; the scale of the map is off by a
        random number of this size.
    data_sheet_error : float, optional
        By which share the data sheet states C too small and b too large.
    controller : controller, optional
        In place of the axis' own, which `None` leaves; `NoController` where the law, then the
        proportional one, is not known.
    reference : bool, optional
        Whether ``x_ref`` is recorded.
    jitter : float, optional
        Standard deviation of the time stamps, in steps; they are recorded as they are.
    gaps : tuple of (float, float), optional
        Begin and end of stretches without rows [s].
    pressures : bool, optional
        Whether the moving mass alone is described, driven by its measured pressures.

    Examples
    --------
    >>> Laboratory(angle_deg=90.0, v_noise=2e-3).clock
    <Clock.UNIFORM: 'uniform'>
    """

    angle_deg: float | None = None
    load_force: float = 0.0
    supply: bool = False
    v_noise: float = 0.0
    a_noise: float = 0.0
    double_rod: bool = False
    other_valve: float = 0.0
    arrangement: Arrangement = Arrangement.TWO_3_2
    source: FlowSource = FlowSource.METERED
    meter_accuracy: float = 0.0
    data_sheet_error: float = 0.0
    controller: PidController | CascadeController | NoController | None = None
    reference: bool = True
    jitter: float = 0.0
    gaps: tuple[tuple[float, float], ...] = ()
    pressures: bool = False

    @property
    def clock(self) -> Clock:
        """How the time stamps are to be read."""
        return Clock.AS_RECORDED if self.jitter or self.gaps else Clock.UNIFORM

    def equip(self, axis: VirtualAxis) -> VirtualAxis:
        """Return an axis as it stands in the laboratory."""
        if self.angle_deg is not None:
            axis = replace(axis, angle_deg=self.angle_deg)
        if self.controller is not None:
            known = self.controller if not isinstance(self.controller, NoController) else None
            axis = replace(axis, controller=known)
        if not self.double_rod:
            return axis
        return replace(axis, S_N=axis.S_P, V_DN=axis.V_DN * axis.S_P / axis.S_N)

    @property
    def effects(self) -> Mapping[str, EffectRequest]:
        """What acts on the axis and is known: measured, or metered."""
        requests: dict[str, EffectRequest] = {}
        if self.load_force:
            requests["vibration"] = {"A": self.load_force, "f": LOAD_FREQUENCY}
        if self.supply:
            requests["supply_droop"] = "medium"
        if self.other_valve:
            requests["valve_mismatch"] = {"gain": self.other_valve}
        return requests

    def describe(self, axis: VirtualAxis, bench: Bench) -> AnyBench:
        """Return the bench description that the laboratory gives of an axis."""
        controller = self.controller or bench.controller
        assert bench.noise is not None
        noise = replace(bench.noise, v=self.v_noise, a=self.a_noise)
        if self.pressures:
            return PressureBench(
                bench.sampling_frequency,
                bench.S_P,
                bench.S_N,
                bench.stroke,
                bench.p_ext,
                datasheet=bench.datasheet,
                noise=noise,
                load=bench.load,
                clock=self.clock,
            )
        valves = (self._valve(axis, 0.0), self._valve(axis, self.other_valve))
        return replace(
            bench,
            controller=controller,
            noise=noise,
            valves=Valves(*valves),
            arrangement=self.arrangement,
            clock=self.clock,
        )

    def _valve(self, axis: VirtualAxis, gain: float) -> ValveData:
        if self.source is not FlowSource.DATA_SHEET:
            return ValveData(self.source, self.meter_accuracy or None)
        valve, off = axis.valve, self.data_sheet_error
        fill = (1.0 + gain) * (valve.leak_supply + valve.k_supply * axis.u_max)
        empty = (1.0 + 0.8 * gain) * (valve.leak_exhaust + valve.k_exhaust * axis.u_max)
        return ValveData(
            self.source,
            C_fill=fill * (1.0 - off),
            C_exhaust=empty * (1.0 - off),
            b=(valve.b_supply + valve.b_exhaust) / 2 * (1.0 + off),
            u_full=axis.u_max,
        )

    def maps(
        self, axis: VirtualAxis, effects: tuple[VirtualEffect, ...], seed: int
    ) -> dict[str, dict[str, FloatArray]]:
        """Return the columns of the metered maps by name of the file, none where nothing is."""
        if self.source is not FlowSource.METERED or self.pressures:
            return {}
        gains = {"flow_map": 1.0}
        if self.other_valve:
            gains = {"flow_map_P": 1.0, "flow_map_N": 1.0 + self.other_valve}
        maps = {
            n: metered_map(axis, effects, seed + i, g) for i, (n, g) in enumerate(gains.items())
        }
        scale = 1.0 + self.meter_accuracy * np.random.default_rng([seed, 9]).standard_normal()
        for table in maps.values():  # of one meter
            table["q_m_kg_per_s"] = np.round(scale * table["q_m_kg_per_s"], 9)
        return maps

    def record(
        self,
        axis: VirtualAxis,
        experiment: Experiment | Excitation,
        effects: tuple[VirtualEffect, ...],
        fs: float,
        duration: float,
        seed: int,
        name: str,
    ) -> Recording:
        """Return a record with the channels and the clock of the laboratory."""
        drive = experiment.excitation(axis, fs, duration, seed)
        run = simulate_axis(axis, drive, effects, fs, seed, jitter=self.jitter)
        channels = shown_channels(axis, run.rows)
        rng = np.random.default_rng([seed, 8])

        def measured(values: FloatArray, noise: float) -> FloatArray:
            return values + noise * rng.standard_normal(values.size)

        if self.supply:
            p_supply = run.states[:, layout.P_SUPPLY]
            channels["p_supply"] = measured(p_supply, axis.sensors.p_noise)
        if self.v_noise:
            channels["v"] = measured(run.states[:, layout.V], self.v_noise)
        if self.a_noise:
            channels["a"] = measured(run.accelerations, self.a_noise)
        if self.load_force:
            force = self.load_force * np.sin(2 * np.pi * LOAD_FREQUENCY * run.t)
            channels["F_load"] = measured(force, LOAD_NOISE)
        if self.arrangement is Arrangement.ONE_5_3:
            channels = {"u": channels.pop("u_P")} | channels
            del channels["u_N"]
        if self.pressures:
            channels = {n: v for n, v in channels.items() if n not in ("u_P", "u_N")}
        elif self.reference:
            channels["x_ref"] = drive.x_ref
        kept = ~np.any(
            [(begin <= run.t) & (run.t < end) for begin, end in self.gaps or [(0, 0)]], 0
        )
        hold = InputHold.LINEAR if self.pressures else InputHold.ZERO
        rows = {channel: values[kept] for channel, values in channels.items()}
        return Recording(run.t[kept], rows, name, "virtual bench", hold, clock=self.clock)
