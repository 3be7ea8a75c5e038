"""Time plots with Bokeh: linked time axes, values at the pointer, curves that can be hidden."""

import json
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from pneumo_casadi.data.recording.curves import MEASURED, POINTS, Curves
from pneumo_casadi.report.interactive.look import detail_seconds, line_look

#: Height of an output's panel and of its residuals' [pixels].
HEIGHT, RESIDUAL_HEIGHT = 190, 120
#: Display units: SI unit -> (text, factor) of an output and of its residual.
_UNITS = {"m": ("mm", 1e3), "Pa": ("kPa", 1e-3), "m/s": ("mm/s", 1e3)}


def can_interact() -> bool:
    """Tell whether Bokeh is installed, without importing it."""
    return find_spec("bokeh") is not None


def load_bokeh() -> None:
    """Import what a plot needs, if it is installed; that takes longer than to draw one."""
    if can_interact():
        import_module("bokeh.embed")


def library() -> str:
    """Return Bokeh's script as its package installs it: nothing is loaded from elsewhere."""
    from bokeh.resources import Resources

    return str(Resources(mode="inline", components=["bokeh"]).js_raw[0])


def time_plot(curves: Curves) -> str:
    """Return the plot of one record as JSON for ``Bokeh.embed.embed_item``.

    Parameters
    ----------
    curves : Curves
        Measured and simulated outputs.

    Notes
    -----
    All curves come from one table, so that the values at a time are shown together. Renderers are
    named as their curve, by which the page shows and hides them.
    """
    from bokeh.embed import json_item
    from bokeh.layouts import column
    from bokeh.models import ColumnDataSource, CrosshairTool, Range1d, Span

    few = curves.thinned(POINTS)
    source = ColumnDataSource(_columns(few))
    margin = 0.01 * float(few.t[-1] - few.t[0])
    x_range = Range1d(
        float(few.t[0]) - margin,
        float(few.t[-1]) + margin,
        bounds=(float(few.t[0]) - margin, float(few.t[-1]) + margin),
        name="time",
    )
    line = Span(dimension="height", line_dash="dashed", line_color="#8c8c8c")
    panels = []
    for output in few.values:
        panels.append(_panel(few, output, source, x_range, residual=False))
        panels.append(_panel(few, output, source, x_range, residual=True))
    for panel in panels:
        panel.add_tools(CrosshairTool(overlay=line))
    panels[-1].xaxis.axis_label = "t [s]"
    panels[-1].height += 30
    layout = column(panels, sizing_mode="stretch_width")
    # Inside a script no name of a record may end it.
    return json.dumps(json_item(layout), separators=(",", ":")).replace("<", "\\u003c")


def detail_of(curves: Curves) -> list[float]:
    """Return start and end of the interval with the largest difference [s]."""
    return [round(edge, 4) for edge in curves.largest_difference(detail_seconds(curves))]


def _columns(curves: Curves) -> dict[str, Any]:
    """Return what is drawn as 32-bit numbers in display units: half the size of the page."""
    columns = {"t": curves.t.astype("float32")}
    for output, values in curves.values.items():
        _, factor = _unit(curves.units[output])
        for k, name in enumerate(values):
            columns[f"{output}_{k}"] = (factor * values[name]).astype("float32")
            if name != MEASURED:
                residual = factor * curves.residual(output, name)
                columns[f"e_{output}_{k}"] = residual.astype("float32")
    return columns


def _panel(curves: Curves, output: str, source: Any, x_range: Any, residual: bool) -> Any:
    from bokeh.models import BoxAnnotation, HoverTool
    from bokeh.plotting import figure

    unit, factor = _unit(curves.units[output])
    panel = figure(
        height=RESIDUAL_HEIGHT if residual else HEIGHT,
        sizing_mode="stretch_width",
        x_range=x_range,
        tools="xbox_zoom,xpan",
        active_drag="xbox_zoom",
        toolbar_location=None,
        y_axis_label=f"residual [{unit}]" if residual else f"{output} [{unit}]",
        min_border_left=72,  # one width, so that the time axes stand above each other
        background_fill_alpha=0,
        border_fill_alpha=0,
        outline_line_color="#8c8c8c",
    )
    first, prefix, tips = None, "e_" if residual else "", [("t", "@t{0.000} s")]
    for k, name in enumerate(curves.values[output]):
        if residual and name == MEASURED:
            continue
        column = f"{prefix}{output}_{k}"
        colour, dash = line_look(k)
        drawn = panel.line(
            "t", column, source=source, color=colour, line_dash=dash, name=name,
            line_width=4 if name == MEASURED else 1.5,
        )  # fmt: skip
        first = first or drawn
        tips.append((name, f"@{column}{{0.000}} {unit}"))
    if residual and curves.noise[output]:
        band = 2 * curves.noise[output] * factor
        shade = {"fill_color": "#8c8c8c", "fill_alpha": 0.25, "level": "underlay"}
        panel.add_layout(BoxAnnotation(bottom=-band, top=band, **shade))
    panel.add_tools(
        HoverTool(renderers=[first], mode="vline", tooltips=tips, line_policy="nearest")
    )
    for axis in panel.axis:
        axis.axis_label_text_font_style = "normal"
    panel.grid.grid_line_alpha = 0.3
    return panel


def _unit(unit: str) -> tuple[str, float]:
    return _UNITS.get(unit, (unit, 1.0))
