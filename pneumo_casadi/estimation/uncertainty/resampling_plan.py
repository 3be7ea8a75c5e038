"""Which residuals a block bootstrap draws, and in blocks of which length."""

from dataclasses import dataclass

import numpy as np

from pneumo_casadi.estimation.uncertainty.optimum import Optimum
from pneumo_casadi.estimation.uncertainty.replicates import fingerprint
from pneumo_casadi.estimation.uncertainty.resampling import (
    block_length,
    draw_circular_blocks,
    retained_variance,
)
from pneumo_casadi.parameters import FloatArray

#: Share of the residuals' variance that the fit, or the ends of blocks, may have taken out and
#: that is given back.
MOST_LOST = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class ResamplingPlan:
    """What is resampled: residuals with their block lengths, of the records, then of the map."""

    residuals: tuple[FloatArray, ...]
    lengths: tuple[int, ...]
    seed: int

    @classmethod
    def make(cls, optimum: Optimum, length: float | None, seed: int) -> "ResamplingPlan":
        """Choose the block lengths, and scale the residuals for the variance that is lost."""
        raw = block_residuals(optimum)
        n, dt = optimum.result.segments[0].n, optimum.records[0].dt
        lengths = [
            block_length(e) if length is None else min(e.shape[1], max(1, round(length / (n * dt))))
            for e in raw
        ]
        drawn = sum(e.shape[1] / own for e, own in zip(raw, lengths, strict=True))
        fitted = len(optimum.names) + sum(x_0.size for x_0 in optimum.result.initial_states)
        residuals = [
            scale_residuals(e, own, fitted / len(e) / drawn, length is None)
            for e, own in zip(raw, lengths, strict=True)
        ]
        anchor = optimum.problem.anchor
        if anchor is not None and anchor.n_points:
            g = optimum.problem.anchor_residuals(optimum.point.theta)[None, : anchor.n_points]
            lengths.append(block_length(g))
            lost = len(anchor.names) * lengths[-1] / g.size
            residuals.append(scale_residuals(g, lengths[-1], lost))
        return cls(tuple(residuals), tuple(lengths), seed)

    def fingerprint(self, optimum: Optimum) -> str:
        """Return a hash of what decides the replicates."""
        result = optimum.result
        arrays = [*self.residuals, result.sigma, result.parameters.values]
        return fingerprint(arrays, [self.lengths, self.seed, result.uncertainty.names])

    def draw_prior(self, index: int, rows: int) -> FloatArray:
        """Return the residuals of prior knowledge of one replicate, (rows,)."""
        seed = np.random.SeedSequence(self.seed, spawn_key=(index, 1))
        return np.random.default_rng(seed).normal(size=rows)

    def draw_residuals(self, index: int) -> list[FloatArray]:
        """Return the residuals of one replicate."""
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(index,)))
        return [
            e[:, draw_circular_blocks(rng, e.shape[1], length)]
            for e, length in zip(self.residuals, self.lengths, strict=True)
        ]


def block_residuals(optimum: Optimum) -> list[FloatArray]:
    """Return the residuals of block means of each record, shape (ny, K), windows joined."""
    result = optimum.result
    parts: dict[int, list[FloatArray]] = {}
    for segment, fitted in zip(result.segments, result.fitted, strict=True):
        parts.setdefault(segment.record, []).append(segment.y - fitted)
    return [np.hstack(parts[record]) for record in sorted(parts)]


def scale_residuals(e: FloatArray, length: int, lost: float, ends: bool = True) -> FloatArray:
    """Centre residuals; scale up for the variance lost to the fit and, if `ends`, to block ends."""
    left = np.full(len(e), 1 - min(lost, MOST_LOST))
    if ends:
        left *= np.maximum(retained_variance(e, length), 1 - MOST_LOST)
    scaled: FloatArray = (e - e.mean(axis=1, keepdims=True)) / np.sqrt(left)[:, None]
    return scaled
