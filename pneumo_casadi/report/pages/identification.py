"""The report as one HTML file with all figures embedded."""

import base64
import re
from dataclasses import dataclass
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from pneumo_casadi.estimation.output_error import OutputErrorResult
from pneumo_casadi.estimation.wls import format_table
from pneumo_casadi.identification.result import Identification
from pneumo_casadi.identification.result_file import identification_provenance
from pneumo_casadi.report.pages.drawing import NOT_DRAWN, matplotlib_installed
from pneumo_casadi.report.tables.content import all_tables
from pneumo_casadi.report.tables.table import Table, with_symbols

#: Size of an SVG file, in points: what Matplotlib writes into its first tag.
_SVG_SIZE = re.compile(rb'<svg[^>]*?\bwidth="([\d.]+)pt"[^>]*', re.DOTALL)
_SVG_HEIGHT = re.compile(rb'\bheight="([\d.]+)pt"')
#: Code in a sentence.
_CODE = re.compile("`([^`]+)`")
#: CSS pixels a point.
_POINT = 96 / 72


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure as PNG or SVG.

    Parameters
    ----------
    name : str
        Of its file, without suffix.
    content : bytes
        The PNG or SVG file.
    caption : str
        What it shows; also its alternative text.
    """

    name: str
    content: bytes
    caption: str

    @property
    def is_svg(self) -> bool:
        """Whether the file is a drawing, not a raster."""
        return not self.content.startswith(b"\x89PNG")

    @property
    def uri(self) -> str:
        """The picture as a data URI."""
        kind = "svg+xml" if self.is_svg else "png"
        return f"data:image/{kind};base64," + base64.b64encode(self.content).decode("ascii")

    @property
    def width(self) -> int:
        """Width in pixels, as the file states it."""
        return self._svg_size[0] if self.is_svg else int.from_bytes(self.content[16:20], "big")

    @property
    def height(self) -> int:
        """Height in pixels, as the file states it."""
        return self._svg_size[1] if self.is_svg else int.from_bytes(self.content[20:24], "big")

    @property
    def dense(self) -> float:
        """Pixels of the file for each one of the page."""
        return 0.6 if self.is_svg else 1.6

    @property
    def _svg_size(self) -> tuple[int, int]:
        first = _SVG_SIZE.search(self.content)
        height = _SVG_HEIGHT.search(first.group(0)) if first else None
        if first is None or height is None:
            raise ValueError(f"{self.name}: no PNG file, and no SVG file with its size in points")
        return round(float(first.group(1)) * _POINT), round(float(height.group(1)) * _POINT)


def html_report(
    identification: Identification, pictures: list[Picture], paper: bool = False
) -> str:
    """Return the report of an identification as one HTML page.

    Parameters
    ----------
    identification : Identification
        What was identified.
    pictures : list of Picture
        Its figures, in order.
    paper : bool, optional
        Whether to set the paper's Table 1 beside the results.
    """
    return page(
        "report.html.jinja",
        identification=identification,
        result=identification.output_error,
        tables=all_tables(identification, paper),
        stages=_stages(identification.output_error),
        pictures=pictures,
        wls=format_table(identification.wls, robust=True),
        plan=identification.wls.plan.describe(),
        provenance=identification_provenance(identification.case, identification.options),
    )


def page(template: str, **content: Any) -> str:
    """Return a filled-in template of this package; all text is escaped."""
    environment = Environment(
        loader=PackageLoader("pneumo_casadi", "report/pages/templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=_unbroken,
    )
    content["not_drawn"] = "" if matplotlib_installed() else NOT_DRAWN
    environment.filters["marked"] = _marked
    return environment.get_template(template).render(**content).lstrip()


def _marked(text: str) -> Markup:
    """Return a sentence with `code` as HTML code and parameters as symbols."""
    escaped = str(escape(_unbroken(with_symbols(text))))
    return Markup(_CODE.sub(r"<code>\1</code>", escaped))


def _unbroken(value: Any) -> Any:
    """Keep numbers and their units on one line."""
    return value.replace(" %", "\N{NO-BREAK SPACE}%") if isinstance(value, str) else value


def _stages(result: OutputErrorResult) -> Table:
    rows = [
        (stage.name, stage.status, str(stage.iterations), f"{stage.cost:.6g}")
        for stage in result.stages
    ]
    return Table("All solves", ("stage", "status", "iterations", "cost"), tuple(rows))
