"""What records cover: their length, sampling rate and range of motion, as plain values."""

from collections.abc import Mapping, Sequence
from typing import Any

from pneumo_casadi.data.recording.recording import Recording
from pneumo_casadi.parameters import FloatArray

#: Channels whose range is told; velocity besides.
CHANNELS = ("x", "p_P", "p_N", "F")
#: Span of the differences of the position [s]: longer than noise, shorter than motion.
SPAN = 0.02


def record_ranges(records: Mapping[str, Sequence[Recording]]) -> list[dict[str, Any]]:
    """Return what each record covers.

    Parameters
    ----------
    records : mapping of str to sequence of Recording
        Records by what they are used for.

    Returns
    -------
    list of dict
        ``name``, ``use``, ``duration`` [s], ``rate`` [Hz], and ``ranges``: least and largest value
        of position ``x`` [m], pressures ``p_P, p_N`` [Pa], force ``F`` [N] where they were
        recorded, and of the velocity ``v`` [m/s], differences of the position over 20 ms.

    Examples
    --------
    >>> from pneumo_casadi.data import example_case
    >>> case = example_case()
    >>> (covered,) = record_ranges({"held out": case.validate})
    >>> covered["use"], covered["rate"], [round(x, 3) for x in covered["ranges"]["x"]]
    ('held out', 5000.0, [-0.044, 0.057])
    """
    return [_covered(record, use) for use, those in records.items() for record in those]


def _covered(record: Recording, use: str) -> dict[str, Any]:
    ranges = {name: _range(record[name]) for name in CHANNELS if name in record}
    rows = max(1, round(SPAN / record.dt))
    if "x" in record and rows < record.N:
        moved = record["x"][rows:] - record["x"][:-rows]
        ranges["v"] = _range(moved / (record.t[rows:] - record.t[:-rows]))
    return {
        "name": record.name,
        "use": use,
        "duration": float(f"{record.duration:.6g}"),
        "rate": float(f"{record.sampling_frequency:.6g}"),
        "ranges": ranges,
    }


def _range(values: FloatArray) -> list[float]:
    return [float(f"{value:.4g}") for value in (values.min(), values.max())]
