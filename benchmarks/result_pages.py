"""Write tables and figures of README and result pages from the committed results.

``python benchmarks/result_pages.py`` rewrites what stands between the markers
``<!-- table: NAME -->`` and ``<!-- end -->`` of `PAGES`; with ``--check`` it changes nothing and
fails if a page is stale.
"""

import argparse
import json
import re
import sys
from pathlib import Path

from tables import TABLES

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs" / "results").glob("*.md")))
MARKED = re.compile(r"<!-- table: (?P<name>\S+) -->.*?<!-- end -->", re.DOTALL)


def main() -> None:
    """Rewrite or check the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing, exit 1 if stale")
    check = parser.parse_args().check
    stale = [page for page in PAGES if updated(page.read_text("utf-8")) != page.read_text("utf-8")]
    if check:
        sys.exit(", ".join(str(page.relative_to(ROOT)) for page in stale) or 0)
    for page in stale:
        page.write_text(updated(page.read_text("utf-8")), encoding="utf-8")


def updated(text: str) -> str:
    """Return a text with all its tables made from the committed results."""

    def table(match: re.Match[str]) -> str:
        make, *names = TABLES[match["name"]]
        results = [json.loads((RESULTS / f"{name}.json").read_text("utf-8")) for name in names]
        return f"<!-- table: {match['name']} -->\n{make(*results)}\n<!-- end -->"

    return MARKED.sub(table, text)


if __name__ == "__main__":
    main()
