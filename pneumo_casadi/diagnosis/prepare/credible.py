"""Fits that physics, the log or the metered map contradict: another effect acts."""

from collections.abc import Mapping, Sequence

from pneumo_casadi.diagnosis.prepare.study import Study
from pneumo_casadi.errors import FitError, ModelError
from pneumo_casadi.estimation.output_error.result import flow_map_deviation
from pneumo_casadi.model.effect import Effect

#: Least delay of the command that is a valve's [s]: the fastest spools of data sheets have 400 Hz.
#: A shorter one is of sampling: records of 1 and 5 kHz without valve dynamics gave 0.15 to 0.29 ms.
LEAST_COMMAND_DELAY = 5e-4
#: Share of the stated mass that a model with effects keeps: no data sheet is off by ten times.
LEAST_MASS = 0.1


def moving_mass(effects: Sequence[Effect], values: Mapping[str, float]) -> float:
    """Return the mass that moves in a model, those of its effects included [kg]."""
    return values["M"] + sum(values[name] for name in masses_of(effects))


def masses_of(effects: Sequence[Effect]) -> list[str]:
    """Return the full names of the parameters that are masses of effects."""
    return [f"{effect.name}.{short}" for effect in effects for short in effect.masses]


def least_mass(study: Study) -> float:
    """Return the mass that a model with effects keeps [kg]; 0 without a data sheet.

    Friction that cancels the force explains nothing: both sides of the force balance vanish, and
    its residual with them.
    """
    return LEAST_MASS * (study.axis.bench.datasheet.get("M_kg") or 0.0)


def _require_mass(study: Study, effects: Sequence[Effect], values: Mapping[str, float]) -> None:
    """Reject a model that has all but lost the mass of the data sheet."""
    M, least = moving_mass(effects, values), least_mass(study)
    if effects and least > 0 and least > M:
        names = " + ".join(effect.name for effect in effects)
        raise FitError(
            f"{names}: M = {M:.3g} kg is not credible beside the "
            f"{study.axis.bench.datasheet['M_kg']:.3g} kg of the data sheet, the force balance "
            "vanishes: another effect acts"
        )


def require_credible(study: Study, effects: Sequence[Effect], values: Mapping[str, float]) -> None:
    """Reject a valve shape that the metered map contradicts, and values out of range.

    A delay of the command is told from the clock of the log only if it is longer than the time
    between two samples: where a controller runs faster, the log has held its commands for half. Of
    several, one a valve, the longest counts.

    Raises
    ------
    FitError
        Naming the parameter and what is known of it.
    """
    for effect in effects:
        prefix = f"{effect.name}."
        own = {k.removeprefix(prefix): v for k, v in values.items() if k.startswith(prefix)}
        for name, (low, high) in effect.credible_at(own).items():
            if name not in own:
                raise ModelError(f"effect {effect.name}: credible_at names no parameter: {name}")
            value = own[name]
            if not low <= value <= high:
                raise FitError(
                    f"{effect.name}.{name} = {value:.3g} is not credible, by physics it is "
                    f"{low:.3g} to {high:.3g}: another effect acts"
                )
        delays = {name: own[name] for name in effect.command_delays}
        name, least = max(delays, key=lambda n: delays[n], default=""), study.sampling_interval
        if delays and delays[name] < max(least, LEAST_COMMAND_DELAY):
            raise FitError(
                f"{effect.name}.{name} = {delays[name]:.3g} s is not credible, it is less than "
                f"{LEAST_COMMAND_DELAY:g} s or the sampling interval of {least:.3g} s and may be a "
                "delay of the log"
            )
    _require_mass(study, effects, values)
    known = study.anchor_with(effects)
    if known is None or known is study.anchor:
        return
    axis = study.axis.with_effects(*effects).with_parameters(dict(values))
    deviation = flow_map_deviation(known, axis)
    if deviation is not None and deviation.rms > study.criteria.map_ratio:
        raise FitError(
            f"the metered flow map contradicts it: with the shape that the motion asks for, its "
            f"residuals are {deviation.rms:.1f} times those of its own fit"
        )
