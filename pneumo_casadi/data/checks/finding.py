"""What a check of the data reports: how grave it is, what it concerns, what to do."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Any

from pneumo_casadi.errors import CaseError


class Grade(StrEnum):
    """How grave a finding or a warning is; the members stand from the gravest on.

    Examples
    --------
    >>> sorted([Grade.NOTE, Grade.SEVERE], key=list(Grade).index)[0].value
    'severe'
    """

    SEVERE = "severe"
    """Results are not to be used before it is corrected."""
    CAUTION = "caution"
    """Some results are worse for it: read what it says before they are used."""
    NOTE = "note"
    """Unusual, and no reason for doubt."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One observation of a check.

    Parameters
    ----------
    grade : Grade
        How grave it is.
    name : str
        What it is, for programs: ``"gauge pressures"``. Findings of several records that have the
        same name are one finding of the case.
    about : str
        Channels, or the field of the bench, that it concerns: ``"p_P, p_N"``, ``"S_P"``.
    text : str
        One sentence with its figures and the remedy.
    file : str, optional
        File that the remedy changes: ``"columns.json"``, ``"bench.json"``, or none.
    suggestion : mapping, optional
        Entries of that file that correct it, ready to be pasted.
    source : str, optional
        Record in which it was observed.

    Examples
    --------
    >>> finding = Finding(Grade.SEVERE, "unit", "p_supply", "`p_supply` is in bar.", "bench.json",
    ...                   {"p_supply_Pa": 7e5})
    >>> finding.sentence
    '`p_supply` is in bar. In bench.json: "p_supply_Pa": 700000.0'
    """

    grade: Grade
    name: str
    about: str
    text: str
    file: str = ""
    suggestion: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "suggestion", MappingProxyType(dict(self.suggestion)))

    def __reduce__(self) -> tuple[Any, ...]:
        # A mapping proxy itself cannot be pickled.
        parts = (self.grade, self.name, self.about, self.text, self.file)
        return Finding, (*parts, dict(self.suggestion), self.source)

    @property
    def sentence(self) -> str:
        """Source, text, and the entries to paste."""
        start = f"{self.source}: " if self.source else ""
        entries = json.dumps(dict(self.suggestion), ensure_ascii=False)[1:-1]
        return f"{start}{self.text}" + (f" In {self.file}: {entries}" if entries else "")

    def as_dict(self) -> dict[str, Any]:
        """Return the finding as it stands in JSON results."""
        return {
            "grade": self.grade.value,
            "name": self.name,
            "about": self.about,
            "text": self.sentence,
            "file": self.file or None,
            "suggestion": dict(self.suggestion),
            "source": self.source,
        }


class ContradictionError(CaseError):
    """A record that cannot come from its bench.

    Parameters
    ----------
    finding : Finding
        What contradicts the bench, and the remedy.
    """

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.sentence)
        self.finding = finding

    def __reduce__(self) -> tuple[Any, ...]:
        return ContradictionError, (self.finding,)


def merge_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings of several records, the gravest first, each name once.

    Examples
    --------
    >>> quiet = [Finding(Grade.NOTE, "rest", "x", "`x` rests.", source=name) for name in ("a", "b")]
    >>> [finding.sentence for finding in merge_findings(quiet)]
    ['a, b: `x` rests.']
    """
    merged: dict[tuple[str, str], Finding] = {}
    order = list(Grade)
    for finding in sorted(findings, key=lambda item: order.index(item.grade)):
        key = (finding.name, finding.about)
        if key not in merged:
            merged[key] = finding
        elif finding.source and finding.source not in merged[key].source.split(", "):
            sources = f"{merged[key].source}, {finding.source}"
            merged[key] = replace(merged[key], source=sources)
    return tuple(merged.values())
