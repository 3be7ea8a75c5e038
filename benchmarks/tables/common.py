"""Pieces shared by the tables."""

SYMBOLS = {"F_c_plus": "F_c⁺", "F_c_minus": "F_c⁻"}


def rows(head: list[str], body: list[list[str]]) -> str:
    """Return a Markdown table, numbers to the right."""
    rule = ["---"] + ["---:"] * (len(head) - 1)
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, rule, *body))
