"""The draw of the sealed check: which effects each case has, and how it is recorded."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pneumo_casadi.data import Case
from pneumo_casadi.effects import EFFECTS
from pneumo_casadi.errors import CaseError
from pneumo_casadi.virtual_bench import (
    ALL_FORMS,
    FORMS,
    Severity,
    draw_background,
    forms_of,
    make_case,
)

#: Forms of the virtual bench that a refit of the nominal parameters absorbs: a constant force of
#: any size leaves held-out residuals as they are, a valve of another gain raises them by less than
#: a fifth unless the gain is a quarter off. Effects declare which parameter checks may fail
#: (`Effect.absorbed_by`), not that nothing else shows: a leak or a hose declares checks too.
ABSORBED_FORMS = ("constant_force", "valve_mismatch")
#: Severities of pairs and of causes outside the catalogue: large enough to be detected.
STRONG = (Severity.MEDIUM, Severity.LARGE)

#: Share of the cases with weak effects besides: half, so that both halves bear figures.
BACKGROUND = 0.5

T = TypeVar("T")


class Kind(Enum):
    """What a case tests."""

    SINGLE = "single"
    """One effect of the catalogue, at any severity; medium or large among weak effects."""
    PAIR = "pair"
    """Two effects of the catalogue, medium or large."""
    NONE = "none"
    """Nothing is wrong."""
    ABSORBED = "absorbed"
    """One of `ABSORBED_FORMS`, at any severity; medium or large among weak effects."""
    LEFT_OUT = "left_out"
    """One effect, medium or large, that this diagnosis' catalogue lacks."""
    NEVER_LISTED = "never_listed"
    """One effect, medium or large, that no catalogue has."""


@dataclass(frozen=True, slots=True)
class Proportions:
    """How many cases of each kind there are among 160; other numbers go in proportion.

    Parameters
    ----------
    single, pair, none, absorbed, left_out, never_listed : float
        Of each `Kind`.

    Raises
    ------
    CaseError
        If one is negative, or all are zero.

    Examples
    --------
    >>> [count for count in Proportions().counts(160).values()]
    [75, 25, 20, 10, 15, 15]
    >>> sum(Proportions().counts(7).values())
    7
    """

    single: float = 75.0
    pair: float = 25.0
    none: float = 20.0
    absorbed: float = 10.0
    left_out: float = 15.0
    never_listed: float = 15.0

    def __post_init__(self) -> None:
        values = [getattr(self, field.name) for field in fields(self)]
        if min(values) < 0 or sum(values) <= 0:
            raise CaseError(f"proportions {values}: none may be negative, and one must be positive")

    def counts(self, cases: int) -> dict[Kind, int]:
        """Return the number of cases of each kind, by the largest remainders."""
        shares = np.array([getattr(self, kind.value) for kind in Kind], dtype=float)
        exact = cases * shares / shares.sum()
        whole = np.floor(exact + 1e-9)
        order = np.argsort(-(exact - whole), kind="stable")
        whole[order[: cases - int(whole.sum())]] += 1
        return {kind: int(count) for kind, count in zip(Kind, whole, strict=True)}


@dataclass(frozen=True, slots=True)
class Draw:
    """One case as drawn: its label.

    Parameters
    ----------
    name : str
        Name of its folder, unrelated to the effects.
    kind : Kind
        What the case tests.
    seed : int
        Of axis, sizes, references and noise.
    effects : mapping of str to str
        Severity by name of the cause.
    forms : mapping of str to str
        Form of each cause, as the virtual bench names it; the usual one where it is missing.
    background : tuple of str
        Forms of the weak effects besides; empty for a clean case.
    weak : str
        Severity that these have a tenth of.
    """

    name: str
    kind: Kind
    seed: int
    effects: Mapping[str, str]
    forms: Mapping[str, str] = field(default_factory=dict)
    background: tuple[str, ...] = ()
    weak: str = Severity.SMALL.value

    @property
    def without(self) -> tuple[str, ...]:
        """Causes that this diagnosis' catalogue lacks, in all their forms."""
        return tuple(self.effects) if self.kind is Kind.LEFT_OUT else ()

    @property
    def listed(self) -> bool:
        """Whether the catalogue given holds every cause."""
        return self.kind not in (Kind.LEFT_OUT, Kind.NEVER_LISTED)

    @property
    def weak_causes(self) -> frozenset[str]:
        """Causes of the weak effects."""
        return frozenset(ALL_FORMS[name].cause for name in self.background)

    def as_dict(self) -> dict[str, Any]:
        """Return the label as plain data."""
        return {
            "name": self.name,
            "kind": self.kind.value,
            "seed": self.seed,
            "effects": dict(self.effects),
            "forms": dict(self.forms),
            "background": list(self.background),
            "weak": self.weak,
        }

    @staticmethod
    def of(label: Mapping[str, Any]) -> "Draw":
        """Return the draw that a label describes."""
        return Draw(
            label["name"],
            Kind(label["kind"]),
            label["seed"],
            dict(label["effects"]),
            dict(label.get("forms", {})),
            tuple(label.get("background", ())),
            label.get("weak", Severity.MEDIUM.value),  # which labels did not tell before
        )


def draw_cases(
    cases: int,
    seed: int,
    proportions: Proportions | None = None,
    background: float = BACKGROUND,
    weak: Severity = Severity.SMALL,
) -> tuple[Draw, ...]:
    """Draw cases in shuffled order.

    Causes and severities are distributed as evenly as their number allows: 75 singles are every
    listed cause at every severity. A cause beside weak effects is medium or large, so that it
    dominates. Pairs and causes left out are taken from causes that
    trajectories can reveal. The form of each cause is drawn from those that the virtual bench has.

    Parameters
    ----------
    cases : int
        How many.
    seed : int
        Secret to the diagnosis; the same seed draws the same cases.
    proportions : Proportions, optional
        Of the kinds.
    background : float, optional
        Share of the cases of every kind that have weak effects besides, 0 to 1.
    weak : Severity, optional
        What weak effects have a tenth of.

    Returns
    -------
    tuple of Draw
        Named ``w001`` and so on.

    Raises
    ------
    CaseError
        If there would be no case.

    Examples
    --------
    >>> [draw.name for draw in draw_cases(3, seed=5)]
    ['w001', 'w002', 'w003']
    """
    if cases < 1:
        raise CaseError(f"{cases} cases: draw at least one")
    if seed < 0:
        raise CaseError(f"seed {seed}: a seed is not negative")
    rng = np.random.default_rng([seed, 7])
    drawn: list[tuple[Kind, dict[str, str]]] = []
    for kind, count in (proportions or Proportions()).counts(cases).items():
        drawn += [(kind, effects) for effects in _effects_of(kind, count, rng)]
    order = rng.permutation(cases)
    seeds = rng.integers(2**40, size=cases)
    digits = max(3, len(str(cases)))
    forms = [{cause: _any_form(cause, rng) for cause in effects} for _, effects in drawn]
    clouded = _clouded(drawn, background, rng)
    drawn = [
        (kind, _at_least_medium(effects, rng) if weak else effects)
        for (kind, effects), weak in zip(drawn, clouded, strict=True)
    ]
    besides = [
        draw_background(rng, effects) if clouded[i] else () for i, (_, effects) in enumerate(drawn)
    ]
    return tuple(
        Draw(
            f"w{number:0{digits}d}",
            drawn[i][0],
            int(seeds[i]),
            drawn[i][1],
            forms[i],
            besides[i],
            weak.value,
        )
        for number, i in enumerate(order, 1)
    )


def _any_form(cause: str, rng: np.random.Generator) -> str:
    forms = forms_of(cause)
    return forms[int(rng.integers(len(forms)))]


def _clouded(
    drawn: Sequence[tuple[Kind, Any]], share: float, rng: np.random.Generator
) -> list[bool]:
    """Return which cases have a background: the share of every kind, rounded to either side."""
    clouded = [False] * len(drawn)
    for kind in Kind:
        mine = [i for i, (drawn_kind, _) in enumerate(drawn) if drawn_kind is kind]
        count = int(share * len(mine) + rng.random())
        for i in rng.permutation(len(mine))[:count]:
            clouded[mine[int(i)]] = True
    return clouded


def _at_least_medium(effects: Mapping[str, str], rng: np.random.Generator) -> dict[str, str]:
    """Return effects that stand out of a background."""
    small = Severity.SMALL.value
    return {
        name: _any(STRONG, rng) if severity == small else severity
        for name, severity in effects.items()
    }


def _effects_of(kind: Kind, count: int, rng: np.random.Generator) -> Iterator[dict[str, str]]:
    listed = [name for name, form in FORMS.items() if form.listed and name in EFFECTS]
    shown = [name for name in listed if name not in ABSORBED_FORMS]
    unlisted = [name for name, form in FORMS.items() if not form.listed]
    if kind is Kind.NONE:
        yield from ({} for _ in range(count))
    elif kind is Kind.PAIR:
        yield from _pairs(shown, count, rng)
    else:
        names, severities = {
            Kind.SINGLE: (listed, tuple(Severity)),
            Kind.ABSORBED: (ABSORBED_FORMS, tuple(Severity)),
            Kind.LEFT_OUT: (shown, STRONG),
            Kind.NEVER_LISTED: (unlisted, STRONG),
        }[kind]
        options = [(name, severity) for name in names for severity in severities]
        if len(options) > count:  # spread over the forms first
            chosen = _cycled(names, count, rng)
            yield from ({name: _any(severities, rng)} for name in chosen)
        else:
            yield from ({name: severity.value} for name, severity in _cycled(options, count, rng))


def _pairs(names: Sequence[str], count: int, rng: np.random.Generator) -> Iterator[dict[str, str]]:
    for _ in range(count):
        first, second = rng.choice(len(names), 2, replace=False)
        yield {names[i]: _any(STRONG, rng) for i in sorted((int(first), int(second)))}


def _any(severities: Sequence[Severity], rng: np.random.Generator) -> str:
    return severities[int(rng.integers(len(severities)))].value


def _cycled(options: Sequence[T], count: int, rng: np.random.Generator) -> list[T]:
    """Return options in random order; none is repeated before all were taken."""
    chosen: list[T] = []
    while len(chosen) < count:
        chosen += [options[i] for i in rng.permutation(len(options))]
    return chosen[:count]


def make(draw: Draw, folder: str | Path, duration: float = 20.0, fs: float = 1000.0) -> Case:
    """Record a drawn case into a folder that does not contain its label."""
    requests = {draw.forms.get(cause, cause): severity for cause, severity in draw.effects.items()}
    return make_case(
        folder,
        draw.seed,
        requests,
        fs=fs,
        duration=duration,
        background=draw.background,
        weak=draw.weak,
    ).case
