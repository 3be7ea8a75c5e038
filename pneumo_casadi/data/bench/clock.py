"""Whether the time stamps of a record are those of a uniform clock."""

from enum import StrEnum


class Clock(StrEnum):
    """How time stamps are read."""

    UNIFORM = "uniform"
    """Rounded stamps of a uniform clock; jitter and gaps are errors."""
    AS_RECORDED = "as recorded"
    """Real stamps: every interval has its own length, and gaps split a record."""
