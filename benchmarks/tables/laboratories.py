"""Tables on what laboratories own, and on their mistakes."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tables.common import rows

#: Parameters that the table shows, by the beginning of their names.
GROUPS = ("M", "X_s", "f_v", "F_c")

#: Length to which a line is shown.
LONGEST = 160


def laboratories(result: Mapping[str, Any]) -> str:
    """Return the worst errors and the coverage of every situation."""
    head = ["situation", "axes", *(f"{group} %" for group in GROUPS), "covered %", "usable"]
    body = []
    for name, entry in result["situations"].items():
        worst = entry["worst_error_percent"]
        cells = ["" if np.isnan(w := worst_of(worst, group)) else f"{w:.2f}" for group in GROUPS]
        covered = f"{100 * entry['coverage']:.0f}"
        body.append([name, str(len(entry["axes"])), *cells, covered, entry["usable"]])
    return rows(head, body)


def mistakes(result: Mapping[str, Any]) -> str:
    """Return what the first line says of every mistake, as a list: sentences do not fit a table."""
    return "\n".join(
        f"- {name} (exit code {row['exit_code']}): {_shortened(row['first_line'])}"
        for name, entries in result["mistakes"].items()
        for row in entries
    )


def _shortened(line: str) -> str:
    """Return the beginning of a message, cut between words; its first line may be cut already."""
    if len(line) > LONGEST:
        line = line[:LONGEST].rsplit(" ", 1)[0]
    return line if line.endswith(".") else f"{line} ..."


def worst_of(worst: Mapping[str, float], group: str) -> float:
    """Return the worst error of the parameters whose names begin so; NaN without any."""
    return max((error for name, error in worst.items() if name.startswith(group)), default=np.nan)
