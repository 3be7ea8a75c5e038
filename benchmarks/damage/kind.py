"""A kind of damage: to which file, how it is done, and what is due."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from random import Random


class Due(Enum):
    """What a reader owes to a damaged file."""

    REFUSE = "refuse"
    """An error that names the file, or a severe finding."""
    FINDING = "finding"
    """An error or a finding of any grade."""
    ACCEPT = "accept"
    """No error: a valid variant."""
    ANY = "any"
    """No crash: whether it contradicts depends on the place that is hit."""


class Subject(Enum):
    """What is damaged and read."""

    CASE = "case"
    RESULT = "result"
    EMPS = "emps"


Damage = Callable[[Path, Random], None]


@dataclass(frozen=True)
class Kind:
    """A kind of damage.

    Parameters
    ----------
    name : str
        What is done.
    due : Due
        What is owed.
    damage : callable
        Changes the files of a folder.
    file : str
        Name, or part of it, that an error must hold.
    subject : Subject
        What the folder is.
    """

    name: str
    due: Due
    damage: Damage
    file: str
    subject: Subject = Subject.CASE
