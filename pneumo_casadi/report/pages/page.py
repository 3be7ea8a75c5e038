"""A report as one HTML file that requests nothing: sections, figures, plots, scripts within."""

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from pneumo_casadi.data.recording.curves import Curves
from pneumo_casadi.report.interactive.look import swatch
from pneumo_casadi.report.interactive.time_plot import (
    can_interact,
    detail_of,
    library,
    time_plot,
)
from pneumo_casadi.report.pages.drawing import NOT_DRAWN, matplotlib_installed
from pneumo_casadi.report.tables.table import Table, with_symbols
from pneumo_casadi.report.text.reference import REFERENCE, numbered

#: Size of an SVG file, in points: what Matplotlib writes into its first tag.
_SVG_SIZE = re.compile(rb'<svg[^>]*?\bwidth="([\d.]+)pt"[^>]*', re.DOTALL)
_SVG_HEIGHT = re.compile(rb'\bheight="([\d.]+)pt"')
#: The denominator of a unit, as in kg/(Pa m).
_UNIT = re.compile(r"/\([^()]{1,9}\)")
#: The space between a number and its unit.
_MEASURE = re.compile(r"(?<=\d) (?=(?:s|ms|m|mm|µm|kg|N|Pa|kPa|bar|V|mV|µV|Hz|K|cm²|cm³|ml|l)\b)")
#: What is read as one: the end of an interval, a bound, a value after its sign of equality.
_TOGETHER = re.compile(r"(?<=\d) to (?=[-−\d])|(?:(?<=\|) )?[<>=] (?=[-−\d])")
#: Code in a sentence.
_CODE = re.compile("`([^`]+)`")
#: CSS pixels a point.
_POINT = 96 / 72
#: Figures wider than this take both columns [CSS pixels]: those of the page's width.
_WIDE = 500
#: Width of a column of a window of 1280 pixels, of a character of a table, and of what lies between
#: its columns [CSS pixels].
_COLUMN, _CHARACTER, _BETWEEN = 484, 7.8, 20
#: Characters of the first column after which it is wrapped.
_FIRST = 20
#: What can be done with a time plot.
_HANDLING = (
    "Drag over a plot to enlarge that time in all of them; the pointer shows the values; "
    "`largest difference` goes to where measurement and first simulation differ most."
)
#: Name of the still figure of a record's time plot, before the name of the record.
TIME_FIGURE = "validation_"


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
    def is_wide(self) -> bool:
        """Whether it takes both columns of the page."""
        return self.width / self.dense > _WIDE * 1.25

    @property
    def _svg_size(self) -> tuple[int, int]:
        first = _SVG_SIZE.search(self.content)
        height = _SVG_HEIGHT.search(first.group(0)) if first else None
        if first is None or height is None:
            raise ValueError(f"{self.name}: no PNG file, and no SVG file with its size in points")
        return round(float(first.group(1)) * _POINT), round(float(height.group(1)) * _POINT)


@dataclass(frozen=True, slots=True)
class Plot:
    """A time plot of one record, with the still figure that stands in for it.

    Parameters
    ----------
    json : str
        What Bokeh draws.
    detail : list of float
        Start and end of the interval with the largest difference [s].
    curves : sequence of (str, str)
        Names, and CSS backgrounds that show their lines.
    label : str
        What it shows.
    picture : Picture or None
        The still figure.
    caption : str
        Below the plot: that of the still figure without its enlarged part, and what can be done.
    """

    json: str
    detail: list[float]
    curves: Sequence[tuple[str, str]]
    label: str
    picture: Picture | None
    caption: str = ""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The answer at the head of a report.

    Parameters
    ----------
    grade : {"good", "care", "bad", "effect"}
        Gives the colour; the words say the same.
    words, sentence : str
        In two words, and in one sentence.
    facts : sequence of (str, str)
        The main figures.
    """

    grade: str
    words: str
    sentence: str
    facts: Sequence[tuple[str, str]] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a report; one that holds nothing is left out."""

    anchor: str
    title: str
    sentences: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[Table] = ()
    plots: Sequence[Plot] = ()
    checks: Sequence[tuple[str, str]] = ()
    texts: Sequence[str] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def filled(self) -> bool:
        """Whether it holds anything."""
        parts = (self.sentences, self.pictures, self.plots, self.checks, self.texts)
        return any(parts) or bool(self.provenance) or any(table.rows for table in self.tables)

    @property
    def beside(self) -> bool:
        """Whether the sentences stand beside the figures, which are too few for own rows."""
        narrow = [picture for picture in self.pictures if not picture.is_wide]
        return bool(self.sentences) and len(narrow) in (1, 2)


def html_page(title: str, verdict: Verdict, sections: Sequence[Section]) -> str:
    """Return a report as one HTML page; all text is escaped."""
    environment = Environment(
        loader=PackageLoader("pneumo_casadi", "report/pages/templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=_unbroken,
    )
    environment.filters["marked"] = _marked
    environment.tests["wide"] = is_wide
    filled = [section for section in sections if section.filled]
    plotted = any(section.plots for section in filled)
    template = environment.get_template("report.html.jinja")
    shown = {
        "title": title,
        "verdict": verdict,
        "not_drawn": "" if matplotlib_installed() else NOT_DRAWN,
    }
    if " of [1]" in template.render(**shown, sections=filled, library=""):
        filled = _with_reference(filled)
    return template.render(**shown, sections=filled, library=library() if plotted else "").lstrip()


def _with_reference(sections: Sequence[Section]) -> list[Section]:
    """Return the sections with the reference below the symbols, or in a section of its own."""
    if all(section.anchor != "symbols" for section in sections):
        return [*sections, Section("reference", "Reference", (REFERENCE,))]
    return [
        replace(
            section,
            tables=[replace(each, notes=(*each.notes, REFERENCE)) for each in section.tables],
        )
        if section.anchor == "symbols"
        else section
        for section in sections
    ]


def plots_of(
    curves: Sequence[Curves], pictures: Sequence[Picture]
) -> tuple[list[Plot], list[Picture]]:
    """Return the interactive plots of records, and the pictures that are no part of one.

    Without Bokeh there are no plots, and their still figures are pictures like any other.
    """
    if not can_interact():
        return [], list(pictures)
    still = {picture.name: picture for picture in pictures}
    plots = []
    for each in curves:
        names = next(iter(each.values.values()))
        picture = still.pop(f"{TIME_FIGURE}{each.record}", None)
        shown = "" if picture is None else picture.caption.partition(" Right: ")[0]
        plots.append(
            Plot(
                time_plot(each),
                detail_of(each),
                [(name, swatch(k)) for k, name in enumerate(names)],
                f"Outputs of {each.record} over time, measured and simulated, and the residuals.",
                picture,
                f"{shown} {_HANDLING}".lstrip(),
            )
        )
    return plots, list(still.values())


def is_wide(table: Table) -> bool:
    """Return whether a table needs both columns of the page.

    Examples
    --------
    >>> is_wide(Table("", ("", "estimate"), (("Moving mass M", "16.8975 ± 0.0054 kg"),)))
    False
    >>> is_wide(Table("", ("", "unit", "A", "B"), (("X", "µg/Pa", 25 * "1", 25 * "2"),)))
    True
    """
    characters = 0
    for i, name in enumerate(table.columns):
        longest = max((len(row[i]) for row in table.rows), default=0)
        heading = max(map(len, name.split()), default=0)  # wrapped between words
        characters += max(heading, longest if i else min(longest, _FIRST))
    return _CHARACTER * characters + _BETWEEN * len(table.columns) > _COLUMN


def _marked(text: str) -> Markup:
    """Return a sentence with `code` as HTML code and parameters as symbols."""
    escaped = str(escape(_unbroken(with_symbols(text))))
    return Markup(_CODE.sub(r"<code>\1</code>", escaped))


def _unbroken(value: Any) -> Any:
    """Keep numbers with interval and per cent on one line; what is marked up stays as it is."""
    if isinstance(value, str) and not isinstance(value, Markup):
        space = "\N{NO-BREAK SPACE}"
        value = _TOGETHER.sub(lambda part: part[0].replace(" ", space), _MEASURE.sub(space, value))
        value = numbered(value)
        value = _UNIT.sub(lambda unit: unit[0].replace(" ", space), value)
        return value.replace(" %", f"{space}%").replace(" ± ", f"{space}±{space}")
    return value
