"""The report as one HTML file: everything embedded, nothing requested."""

import base64
from dataclasses import dataclass
from importlib import resources

from jinja2 import Environment, StrictUndefined

from pneumo_casadi.pipeline import Identification
from pneumo_casadi.regression import format_table
from pneumo_casadi.report.content import all_tables
from pneumo_casadi.result_file import provenance


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure as PNG.

    Parameters
    ----------
    name : str
        Of its file, without suffix.
    content : bytes
        The PNG file.
    caption : str
        What it shows; also its alternative text.
    """

    name: str
    content: bytes
    caption: str

    @property
    def uri(self) -> str:
        """The picture as a data URI."""
        return "data:image/png;base64," + base64.b64encode(self.content).decode("ascii")

    @property
    def width(self) -> int:
        """Width in pixels, as the file states it."""
        return int.from_bytes(self.content[16:20], "big")

    @property
    def height(self) -> int:
        """Height in pixels, as the file states it."""
        return int.from_bytes(self.content[20:24], "big")


def html_report(found: Identification, pictures: list[Picture], paper: bool = False) -> str:
    """Return the report of an identification as one HTML page.

    Parameters
    ----------
    found : Identification
        What was identified.
    pictures : list of Picture
        Its figures, in order.
    paper : bool, optional
        Whether to set the paper's Table 1 beside the results.
    """
    template = resources.files("pneumo_casadi.report").joinpath("report.html.jinja")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment.from_string(template.read_text("utf-8")).render(
        found=found,
        result=found.output_error,
        tables=all_tables(found, paper),
        pictures=pictures,
        wls=format_table(found.wls, robust=True),
        plan=found.wls.plan.describe(),
        provenance=provenance(found.case, found.options),
    )
