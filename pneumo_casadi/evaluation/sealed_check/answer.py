"""The answer of a diagnosis, reduced to what can be scored.

- *named*: what the verdict stands for. ``effect``: the effects added, and those said to be
  absorbed beside them. ``ambiguous``: the same, or the first of the set where none was.
  ``absorbed``: the first of the set, or of the ranking. ``none``, ``unknown``, and a diagnosis that
  failed stand for no effect.
- *offered*: the set of effects that the verdict leaves open, *named* included: ``effect`` and
  ``ambiguous`` with all that the data cannot tell from it, ``absorbed`` likewise. Effects that a
  label joins count one by one, so that a set is as large as the effects that it holds.
- *ranking*: the candidates as ranked, whatever the verdict; forms of the same causes are one.
- *weak*: what is told as probably also there, each effect with those that may act in its place.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pneumo_casadi.evaluation.sealed_check.true_balance import MEASUREMENT

#: Verdicts that stand for effects.
NAMING = ("effect", "ambiguous", "absorbed")


@dataclass(frozen=True, slots=True)
class Answer:
    """One verdict.

    Parameters
    ----------
    verdict : str
        In one word.
    named, offered : frozenset of str
        See above.
    ranking : tuple of frozenset of str
        Effects of each candidate, the most probable first.
    probability : float
        Of the first candidate; 0 without one.
    balance : str
        Where the gap is said to lie; empty if it is not said.
    first : str
        Effect that is named first; empty if none is.
    driver : str
        What a discovered term depends on; empty without one.
    acts_in : frozenset of str
        Balances of the discovered term, ``measurement`` for any sensor.
    closes : float or None
        Share of the held-out gap that it closes.
    weak : tuple of frozenset of str
        See above.
    """

    verdict: str
    named: frozenset[str]
    offered: frozenset[str]
    ranking: tuple[frozenset[str], ...]
    probability: float
    balance: str
    first: str = ""
    driver: str = ""
    acts_in: frozenset[str] = frozenset()
    closes: float | None = None
    weak: tuple[frozenset[str], ...] = ()


def read_answer(verdict: Mapping[str, Any]) -> Answer:
    """Reduce the JSON of a diagnosis.

    Examples
    --------
    >>> answer = read_answer({"verdict": "ambiguous", "ambiguous": ["hose", "valve_dynamics"]})
    >>> sorted(answer.named), sorted(answer.offered)
    (['hose'], ['hose', 'valve_dynamics'])
    """
    word = str(verdict["verdict"])
    chances: dict[frozenset[str], float] = {}
    for item in verdict.get("ranking") or ():
        causes = effects_in(item["name"])
        chances[causes] = chances.get(causes, 0.0) + float(item.get("probability") or 0.0)
    ranking = tuple(sorted(chances, key=lambda causes: -chances[causes]))
    added = frozenset(str(item["name"]) for item in verdict.get("effects") or ())
    added |= frozenset(str(name) for name in verdict.get("absorbed") or ())
    alike = [effects_in(label) for label in verdict.get("ambiguous") or ()]
    named: frozenset[str] = frozenset()
    if word in NAMING:
        first = alike[:1] + list(ranking[:1] if word == "absorbed" else ())
        named = added or next(iter(first), named)
    term = verdict.get("discovered") or {}
    return Answer(
        word,
        named,
        union([named, *alike]) if word in NAMING else frozenset(),
        ranking,
        max(chances.values(), default=0.0),
        str((verdict.get("where") or {}).get("balance") or ""),
        next((str(item["name"]) for item in verdict.get("effects") or ()), min(named, default="")),
        str(term.get("driver") or ""),
        frozenset(
            str(name).partition("_")[0] if str(name).startswith(MEASUREMENT) else str(name)
            for name in term.get("balances") or ()
        ),
        (term.get("closes") or {}).get("value"),
        tuple(
            frozenset(map(str, (item["name"], *(item.get("rivals") or ()))))
            for item in verdict.get("besides") or ()
        ),
    )


def effects_in(label: str) -> frozenset[str]:
    """Return the effects that a label joins.

    Examples
    --------
    >>> sorted(effects_in("stribeck + hose"))
    ['hose', 'stribeck']
    """
    return frozenset(part.strip() for part in label.split("+") if part.strip())


def union(sets: Iterable[frozenset[str]]) -> frozenset[str]:
    """Return all that any of some sets holds."""
    return frozenset().union(*sets)
