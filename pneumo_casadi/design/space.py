"""The numbers of a reference as one vector, for an optimiser to move in."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pneumo_casadi.design.reference import COMMON, KINDS, Part
from pneumo_casadi.errors import ModelError
from pneumo_casadi.parameters import FloatArray

#: The paper's experiment: a chirp and squares of several amplitudes, half and half.
PAPER = ("chirp", "squares")
#: Parts shorter than this are left out [s].
SHORTEST = 0.5


@dataclass(frozen=True, slots=True)
class Space:
    """References that can be made of some kinds of motion.

    A point is a vector of numbers from 0 to 1: a weight and the kind's own numbers, kind after
    kind, and last those of the common mode.

    Parameters
    ----------
    kinds : tuple of str
        Kinds of motion.
    common : bool
        Whether both valves may be opened alike.
    duration : float
        Length of the reference [s].

    Examples
    --------
    >>> space = Space(("chirp", "holds"), False, 4.0)
    >>> [part.kind for part in space.parts(space.start)]
    ['chirp']
    """

    kinds: tuple[str, ...]
    common: bool
    duration: float

    def __post_init__(self) -> None:
        known = [name for name in KINDS if name != COMMON]
        unknown = sorted(set(self.kinds) - set(known))
        if unknown or not self.kinds:
            raise ModelError(
                f"no kind of motion {', '.join(unknown) or 'given'}; there are {', '.join(known)}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """What each number of a point is."""
        found = []
        for kind in self.kinds:
            found += [f"{kind}.weight", *(f"{kind}.{one.name}" for one in KINDS[kind].numbers)]
        if self.common:
            found += [f"{COMMON}.{one.name}" for one in KINDS[COMMON].numbers]
        return tuple(found)

    @property
    def start(self) -> FloatArray:
        """The paper's experiment, as far as the kinds allow it."""
        known = [kind for kind in self.kinds if kind in PAPER] or list(self.kinds[:1])
        return self.point(dict.fromkeys(known, 1.0))

    def point(self, weights: dict[str, float]) -> FloatArray:
        """Return the point with these weights and all numbers where they start."""
        found: list[float] = []
        for kind in self.kinds:
            starts = [one.share(one.start) for one in KINDS[kind].numbers]
            found += [weights.get(kind, 0.0), *starts]
        if self.common:
            found += [one.share(one.start) for one in KINDS[COMMON].numbers]
        return np.array(found)

    def parts(self, z: Sequence[float] | FloatArray) -> tuple[Part, ...]:
        """Return the parts that a point stands for; those too short are left out."""
        values = np.clip(np.asarray(z, dtype=float), 0.0, 1.0)
        at, found = 0, []
        for kind in self.kinds:
            numbers = KINDS[kind].numbers
            own = values[at + 1 : at + 1 + len(numbers)]
            scaled = tuple(one.at(float(v)) for one, v in zip(numbers, own, strict=True))
            found.append(Part(kind, float(values[at]), scaled))
            at += 1 + len(numbers)
        total = sum(part.share for part in found)
        if total <= 0:
            found, total = [Part(one.kind, 1.0, one.values) for one in found], len(found)
        long = [part for part in found if part.share / total * self.duration >= SHORTEST]
        kept = long or [max(found, key=lambda part: part.share)]
        whole = sum(part.share for part in kept)
        parts = [Part(one.kind, one.share / whole, one.values) for one in kept]
        if self.common:
            numbers = KINDS[COMMON].numbers
            own = values[at:]
            scaled = tuple(one.at(float(v)) for one, v in zip(numbers, own, strict=True))
            if scaled[0] or scaled[1]:
                parts.append(Part(COMMON, 1.0, scaled))
        return tuple(parts)
