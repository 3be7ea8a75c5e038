"""What a check of the data has noticed: how grave it is, what it concerns, what to do."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any


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
    """One thing that a check has noticed.

    Parameters
    ----------
    grade : Grade
        How grave it is.
    about : str
        Channels, or the field of the bench, that it concerns: ``"p_P, p_N"``, ``"S_P"``.
    text : str
        One sentence with its figures and the remedy.
    file : str, optional
        File that the remedy changes: ``"columns.json"``, ``"bench.json"``, or none.
    suggestion : mapping, optional
        Entries of that file that correct it, ready to be pasted.

    Examples
    --------
    >>> Finding(Grade.NOTE, "x", "`x` rests for 80 % of the record.").suggestion
    mappingproxy({})
    """

    grade: Grade
    about: str
    text: str
    file: str = ""
    suggestion: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "suggestion", MappingProxyType(dict(self.suggestion)))

    def __reduce__(self) -> tuple[Any, ...]:
        parts = (self.grade, self.about, self.text, self.file, dict(self.suggestion))
        return Finding, parts  # a mapping proxy itself cannot be pickled
