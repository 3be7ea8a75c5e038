"""Everything that the fits of one case share."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from pneumo_casadi.data import Recording
from pneumo_casadi.diagnosis.prepare.criteria import CRITERIA, Criteria
from pneumo_casadi.errors import CaseError
from pneumo_casadi.estimation.equation_error.smoothed_motion import (
    SmoothedMotion,
    smooth_motions,
    smoothing_filter,
)
from pneumo_casadi.estimation.flow_anchor import Anchor, anchor_flow
from pneumo_casadi.estimation.wls import fit_wls
from pneumo_casadi.model.axis import Axis
from pneumo_casadi.model.effect import Effect
from pneumo_casadi.signals import FilterPlan, plan_filters_for
from pneumo_casadi.valve import AnyFlowMap

#: Width of the smoothed sign of the velocity; slower rows are left out [m/s].
V_S = 1e-3


@dataclass(frozen=True, eq=False)
class Study:
    """A nominal axis at its start, with the records to fit and those held out.

    Parameters
    ----------
    axis : Axis
        Nominal, at the estimate of weighted least squares.
    flow_map : FlowMap or None
        Metered points.
    train, held_out : tuple of Recording
        Records.
    criteria : Criteria
        What decides the verdict.

    Notes
    -----
    Smoothing is done once a process: a study may be sent to another one.
    """

    axis: Axis
    flow_map: AnyFlowMap | None
    train: tuple[Recording, ...]
    held_out: tuple[Recording, ...]
    criteria: Criteria = CRITERIA

    def __getstate__(self) -> dict[str, object]:
        kept = ("axis", "flow_map", "train", "held_out", "criteria")
        return {name: self.__dict__[name] for name in kept}

    @cached_property
    def smoothed(self) -> tuple[tuple[SmoothedMotion, ...], tuple[SmoothedMotion, ...]]:
        """Records to fit and records held out, smoothed."""
        motions = smooth_motions(self.axis, (*self.train, *self.held_out))
        return motions[: len(self.train)], motions[len(self.train) :]

    @property
    def all_smoothed(self) -> tuple[SmoothedMotion, ...]:
        """All records smoothed, those to fit first."""
        train, held_out = self.smoothed
        return (*train, *held_out)

    @cached_property
    def shows_accelerations(self) -> bool:
        """Whether records are sampled fast enough for differences: else balances tell little."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _planned_filters(self.train) is not None

    @property
    def sampling_interval(self) -> float:
        """Longest time between two samples of a record [s]."""
        return max(record.dt for record in (*self.train, *self.held_out))

    @property
    def anchor(self) -> Anchor | None:
        """What fixes the scale of the flows; see `anchor_flow`."""
        return self.anchor_with(())

    def anchor_with(self, effects: Sequence[Effect]) -> Anchor | None:
        """Return what fixes the scale of the flows of a valve with these effects, if anything."""
        key = tuple(effect.name for effect in effects if effect.metered)
        if key not in self._anchors:
            self._anchors[key] = anchor_flow(self.axis, self.flow_map, effects)
        return self._anchors[key]

    @cached_property
    def _anchors(self) -> dict[tuple[str, ...], Anchor | None]:
        return {}


def start_study(
    axis: Axis,
    flow_map: AnyFlowMap | None,
    train: Sequence[Recording],
    held_out: Sequence[Recording],
    criteria: Criteria = CRITERIA,
) -> Study:
    """Start a study with weighted least squares."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the start may be clipped at a bound
        start = axis.started_at(fit_wls(axis, train, plan=_filters(train)).parameters)
    start = start.with_parameters({"v_s": V_S})
    return Study(start, flow_map, tuple(train), tuple(held_out), criteria)


def _filters(records: Sequence[Recording]) -> FilterPlan:
    """Return the filters of the start; those of the smoothed motion where no others will do."""
    return _planned_filters(records) or smoothing_filter(records[0].dt)


def _planned_filters(records: Sequence[Recording]) -> FilterPlan | None:
    """Return the filters of eq. 14; None if records are too slow to bound their distortion."""
    try:
        return plan_filters_for(records)
    except CaseError:
        return None
