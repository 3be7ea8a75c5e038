"""Rows of a recording: those of consecutive parts, and those that delayed channels share."""

from collections.abc import Mapping, Sequence

from pneumo_casadi.errors import CaseError


def part_edges(
    name: str, N: int, dt: float, parts: int | None, duration: float | None
) -> list[int]:
    """Return the rows at which parts begin, and the row after the last one.

    Parameters
    ----------
    name : str
        Name of the recording, for messages.
    N : int
        Number of its rows.
    dt : float
        Its sample time [s].
    parts : int or None
        Number of parts of equal length (to one row).
    duration : float or None
        Length of a part [s]; the last part is shorter or, if only one row is left, longer.

    Raises
    ------
    CaseError
        If not exactly one of `parts` and `duration` is given, or a part has fewer than two rows.

    Examples
    --------
    >>> part_edges("ramp", 5, 0.1, 2, None), part_edges("ramp", 5, 0.1, None, 0.2)
    ([0, 2, 5], [0, 2, 5])
    """
    if (parts is None) == (duration is None):
        raise CaseError(f"{name}: split into a number of parts or by a duration [s]")
    if parts is not None:
        if not 1 <= parts <= N // 2:
            raise CaseError(f"{name}: {N} rows do not give {parts} parts of two rows or more")
        return [round(N * part / parts) for part in range(parts + 1)]
    rows = round((duration or 0.0) / dt)
    if rows < 2:
        raise CaseError(f"{name}: {duration} s is less than two rows of {dt:g} s")
    return [*range(0, N - 1, rows), N]  # a last single row joins its neighbour


def spread_of_delays(late: Mapping[str, int]) -> int:
    """Return the rows by which channels that are `late` shorten a stretch of rows."""
    return sum(_reach(late))


def rows_with_all(late: Mapping[str, int], stretches: Sequence[slice]) -> list[int]:
    """Return the rows for which every channel has its value within the same stretch of rows.

    Examples
    --------
    >>> rows_with_all({"u": 1}, [slice(0, 3), slice(3, 6)])
    [0, 1, 3, 4]
    """
    before, after = _reach(late)
    kept = [range(part.start + before, part.stop - after) for part in stretches]
    return [row for part in kept for row in part]


def _reach(late: Mapping[str, int]) -> tuple[int, int]:
    """Return the rows before and after a row that its channels are taken from."""
    return max([0, *(-shift for shift in late.values())]), max([0, *late.values()])
