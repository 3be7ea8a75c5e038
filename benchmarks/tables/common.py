"""Pieces shared by the tables."""

from collections.abc import Collection

SYMBOLS = {"F_c_plus": "F_c⁺", "F_c_minus": "F_c⁻"}


def rows(head: list[str], body: list[list[str]], texts: Collection[str] = ()) -> str:
    """Return a Markdown table: numbers to the right; the first column and `texts` to the left."""
    rule = ["---" if name in {head[0], *texts} else "---:" for name in head]
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *body))
