"""Cases for development and tests: folders with the files of a real bench, without labels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd

from pneumo_casadi.data import Case, Recording, read_case, write_case
from pneumo_casadi.errors import CaseError
from pneumo_casadi.runtime.output_folder import check_new
from pneumo_casadi.virtual_bench.axis import VirtualAxis, random_axis
from pneumo_casadi.virtual_bench.catalogue import (
    EffectRequest,
    draw_background,
    effects_for,
    form_named,
    severity_of,
    weak_effects,
)
from pneumo_casadi.virtual_bench.effect import Severity, VirtualEffect
from pneumo_casadi.virtual_bench.experiment import Excitation, Experiment
from pneumo_casadi.virtual_bench.laboratory import Laboratory
from pneumo_casadi.virtual_bench.simulation import record

#: Excitation in the record to identify on, and in the held-out one.
IDENTIFY = Experiment.of("chirp_and_squares")
VALIDATE = Experiment.of("multisine_and_steps")
#: Two equal metered valves, a proportional controller, a steady clock.
USUAL = Laboratory()


@dataclass(frozen=True, slots=True)
class SyntheticCase:
    """A case with its true axis and effects.

    Parameters
    ----------
    case : Case
        As written to its folder.
    axis : VirtualAxis
        The axis without its hidden effects.
    effects : tuple of VirtualEffect
        The labels.
    background : tuple of VirtualEffect
        Weak effects that were added.
    """

    case: Case
    axis: VirtualAxis
    effects: tuple[VirtualEffect, ...]
    background: tuple[VirtualEffect, ...] = ()

    @property
    def labels(self) -> dict[str, object]:
        """What is true of the case, as plain data; it is nowhere in the folder.

        The polytropic indices mean nothing where heat transfer takes their place.
        """
        return {
            "effects": [effect.as_dict() for effect in self.effects],
            "background": [effect.as_dict() for effect in self.background],
            "truth": dict(self.axis.truth),
        }


def make_case(
    folder: str | Path,
    seed: int,
    effects: Mapping[str, EffectRequest] = MappingProxyType({}),
    *,
    fs: float = 1000.0,
    duration: float = 20.0,
    identify: Experiment | Excitation = IDENTIFY,
    validate: Experiment | Excitation = VALIDATE,
    axis: VirtualAxis | None = None,
    laboratory: Laboratory = USUAL,
    background: Sequence[str] | bool = False,
    weak: Severity | str = Severity.SMALL,
) -> SyntheticCase:
    """Record a random axis with hidden effects and write the case folder.

    Parameters
    ----------
    folder : path
        Folder to make.
    seed : int
        Of axis, sizes, references and noise: equal seeds give equal files.
    effects : mapping, optional
        Severity, or quantities [SI], by name of the effect; none by default.
    fs, duration : float, optional
        Sampling frequency [Hz] and length of each record [s].
    identify, validate : Experiment or Excitation, optional
        What the axis does in either record.
    axis : VirtualAxis, optional
        Instead of a random one.
    laboratory : Laboratory, optional
        Valves, sensors and data of the laboratory that records the case.
    background : bool or sequence of str, optional
        Weak effects to add, by name of their form; True draws four to six of other causes.
    weak : Severity or str, optional
        What these have a tenth of.

    Returns
    -------
    SyntheticCase
        The case and its labels, which are not written into the folder.

    Raises
    ------
    CaseError
        If the folder is not empty, duration and frequency make no record, or the seed is negative.
    ModelError
        If an effect, severity or quantity is unknown.

    Examples
    --------
    >>> import tempfile
    >>> import pneumo_casadi as pc
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = pc.make_case(folder, 1, {"stribeck": "medium"}, fs=500.0, duration=2.0)
    >>> [effect["name"] for effect in made.labels["effects"]], made.case.identify[0].N
    (['stribeck'], 1000)
    """
    if not (fs > 0 and duration * fs >= 2):
        raise CaseError(
            f"{folder}: no record: {duration:g} s at {fs:g} Hz is less than 2 rows; give a longer "
            "duration"
        )
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise CaseError(f"{folder}: seed {seed}; give a whole number from 0 on")
    check_new(folder)
    axis = laboratory.equip(axis or random_axis(seed))
    hidden = effects_for(axis, effects, seed)
    if isinstance(background, bool):
        causes = [effect.form.cause for effect in hidden]
        causes += [form_named(name).cause for name in laboratory.effects]
        causes += ["position_delay"] if laboratory.jitter else []  # which the bench cannot record
        drawn = draw_background(np.random.default_rng([seed, 9]), causes)
        background = drawn if background else ()
    besides = weak_effects(axis, background, seed, severity_of(weak))
    hidden = (*hidden, *besides)
    acting = (*hidden, *effects_for(axis, laboratory.effects))

    def recorded(experiment: Experiment | Excitation, name: str, number: int) -> Recording:
        if laboratory == USUAL:
            return record(axis, experiment, hidden, fs, duration, 10 * seed + number, name)
        return laboratory.record(axis, experiment, acting, fs, duration, 10 * seed + number, name)

    rng = np.random.default_rng([seed, 6])
    bench = axis.bench_description(fs, axis.M * rng.uniform(0.97, 1.03))
    maps = laboratory.maps(axis, acting, seed)
    case = write_case(
        folder,
        laboratory.describe(axis, bench),
        [recorded(identify, "identify", 1)],
        [recorded(validate, "validate", 2)],
        maps.get("flow_map"),
    )
    if laboratory != USUAL:
        for name in maps.keys() - {"flow_map"}:
            pd.DataFrame(maps[name]).to_csv(case.folder / f"{name}.csv", index=False)
        case = read_case(folder, check=False)  # gaps split records, columns become signals
    return SyntheticCase(case, axis, hidden[: len(effects)], besides)
