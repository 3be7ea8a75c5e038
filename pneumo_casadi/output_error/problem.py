"""The output-error problem: data, model and unknowns, before any solver is chosen.

Unknowns are the free parameters θ and the states x_k at the ends of all blocks, tied by
x_{k+1} = F(x_k, w_k, θ). The model's mean outputs over a block are m_k = H(x_k, w_k, θ).
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from pneumo_casadi.axis import Axis
from pneumo_casadi.integration import THREADS, BlockFunctions
from pneumo_casadi.output_error.anchor import Anchor
from pneumo_casadi.output_error.segments import Segment
from pneumo_casadi.parameters import FloatArray, Parameters


@dataclass(frozen=True, slots=True)
class Unknowns:
    """A point of the problem, in SI units.

    Parameters
    ----------
    theta : (n,) array
        All parameters of the axis, fixed ones included.
    x : (nx, n_nodes) array
        States at the ends of the blocks, segment after segment (K + 1 each).
    m : (ny, n_blocks) array
        Mean outputs of the model over the blocks.
    """

    theta: FloatArray
    x: FloatArray
    m: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Functions and data of one output-error problem.

    Parameters
    ----------
    axis : Axis
        Model.
    parameters : Parameters
        Values, bounds, scales and freedom.
    segments : tuple of Segment
        Data.
    blocks : BlockFunctions
        Compiled block with sensitivities to the free parameters.
    anchor : Anchor or None
        Residuals of the flow map.
    """

    axis: Axis
    parameters: Parameters
    segments: tuple[Segment, ...]
    blocks: BlockFunctions
    anchor: Anchor | None

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return self.parameters.free_names

    @property
    def n_blocks(self) -> int:
        """Blocks over all segments."""
        return sum(segment.K for segment in self.segments)

    @property
    def n_nodes(self) -> int:
        """Nodes over all segments."""
        return self.n_blocks + len(self.segments)

    @cached_property
    def mapped(self) -> tuple[ca.Function, ca.Function]:
        """Value and sensitivity of all blocks side by side, in two threads."""
        K, both = self.n_blocks, (self.blocks.value, self.blocks.sensitivity)
        value, sensitivity = (f.map(K, "thread", THREADS) if K > 1 else f for f in both)
        return value, sensitivity

    @cached_property
    def starts(self) -> FloatArray:
        """Node index at which each block starts, shape (n_blocks,)."""
        found, node = [], 0
        for segment in self.segments:
            found.append(np.arange(node, node + segment.K))
            node += segment.K + 1
        return np.concatenate(found)

    @cached_property
    def y(self) -> FloatArray:
        """Measured mean outputs, shape (ny, n_blocks)."""
        return np.hstack([segment.y for segment in self.segments])

    @cached_property
    def w(self) -> FloatArray:
        """Inputs of all samples, shape (nw, n_blocks n)."""
        return np.hstack([segment.w for segment in self.segments])

    @property
    def output_scales(self) -> FloatArray:
        """Sizes of the outputs, shape (ny,)."""
        scale = dict(zip(self.axis.states, self.axis.state_scales, strict=True))
        return np.array([scale[name] for name in self.axis.outputs])

    @property
    def free_scales(self) -> FloatArray:
        """Scales of the free parameters, shape (n_free,)."""
        return self.parameters.scales[self.parameters.free_mask]

    def start(self) -> Unknowns:
        """Return the measured start: states from smoothed data, outputs as measured."""
        x = np.hstack([segment.x for segment in self.segments])
        return Unknowns(self.parameters.values, x, self.y)

    def residuals(self, point: Unknowns) -> FloatArray:
        """Return measured minus modelled mean outputs, shape (ny, n_blocks)."""
        return self.y - point.m

    def anchor_residuals(self, theta: FloatArray) -> FloatArray:
        """Return the map's residuals over its noise; empty without an anchor."""
        if self.anchor is None:
            return np.zeros(0)
        at = [self.parameters.index(name) for name in self.anchor.names]
        return self.anchor(theta[at])

    def cost(self, point: Unknowns, sigma: FloatArray) -> float:
        """Return ½ Σ (residual/σ)² over all samples and the flow map."""
        e = self.residuals(point) / sigma[:, None]
        g = self.anchor_residuals(point.theta)
        return 0.5 * float(self.blocks.n * np.sum(e**2) + np.sum(g**2))


def values(problem: Problem, point: Unknowns) -> tuple[FloatArray, FloatArray]:
    """Return ends (nx, K) and mean outputs (ny, K) of all blocks."""
    f, _ = problem.mapped
    starts = np.asarray(point.x[:, problem.starts])
    ends, y = (np.asarray(a) for a in f(starts, problem.w, point.theta[:, None]))
    return ends, y


def sensitivities(
    problem: Problem, point: Unknowns
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return ends (nx, K), outputs (ny, K) and their derivatives to (x_0, θ_free) of all blocks.

    The derivatives have shapes (K, nx, nx + n_free) and (K, ny, nx + n_free).
    """
    K, nx, ny = problem.n_blocks, len(problem.axis.states), len(problem.axis.outputs)
    n = nx + len(problem.free)
    _, f = problem.mapped
    starts = np.asarray(point.x[:, problem.starts])
    ends, y, dx, dy = (np.asarray(a) for a in f(starts, problem.w, point.theta[:, None]))
    return (
        ends,
        y,
        dx.reshape(nx, n, K, order="F").transpose(2, 0, 1),
        dy.reshape(ny, n, K, order="F").transpose(2, 0, 1),
    )
