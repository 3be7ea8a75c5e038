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
        names = []
        for kind in self.kinds:
            names += [
                f"{kind}.weight",
                *(f"{kind}.{number.name}" for number in KINDS[kind].numbers),
            ]
        if self.common:
            names += [f"{COMMON}.{number.name}" for number in KINDS[COMMON].numbers]
        return tuple(names)

    @property
    def start(self) -> FloatArray:
        """The paper's experiment, as far as the kinds allow it."""
        known = [kind for kind in self.kinds if kind in PAPER] or list(self.kinds[:1])
        return self.point(dict.fromkeys(known, 1.0))

    def point(self, weights: dict[str, float]) -> FloatArray:
        """Return the point with these weights and all numbers where they start."""
        values: list[float] = []
        for kind in self.kinds:
            starts = [number.share(number.start) for number in KINDS[kind].numbers]
            values += [weights.get(kind, 0.0), *starts]
        if self.common:
            values += [number.share(number.start) for number in KINDS[COMMON].numbers]
        return np.array(values)

    def parts(self, z: Sequence[float] | FloatArray) -> tuple[Part, ...]:
        """Return the parts that a point stands for; those too short are left out."""
        values = np.clip(np.asarray(z, dtype=float), 0.0, 1.0)
        at, drawn = 0, []
        for kind in self.kinds:
            numbers = KINDS[kind].numbers
            own = values[at + 1 : at + 1 + len(numbers)]
            scaled = tuple(number.at(float(v)) for number, v in zip(numbers, own, strict=True))
            drawn.append(Part(kind, float(values[at]), scaled))
            at += 1 + len(numbers)
        total = sum(part.share for part in drawn)
        if total <= 0:
            drawn, total = [Part(part.kind, 1.0, part.values) for part in drawn], len(drawn)
        long = [part for part in drawn if part.share / total * self.duration >= SHORTEST]
        kept = long or [max(drawn, key=lambda part: part.share)]
        whole = sum(part.share for part in kept)
        parts = [Part(part.kind, part.share / whole, part.values) for part in kept]
        if self.common:
            numbers = KINDS[COMMON].numbers
            own = values[at:]
            scaled = tuple(number.at(float(v)) for number, v in zip(numbers, own, strict=True))
            if scaled[0] or scaled[1]:
                parts.append(Part(COMMON, 1.0, scaled))
        return tuple(parts)
