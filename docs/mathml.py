"""Formulas as MathML, which browsers draw themselves: no script and no request to another host."""

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    latex = " ".join(node.astext().split()).replace(r"\arg\min", r"\mathrm{arg}\,\min")
    formula = convert(latex, display="block")
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    translator.body.append(f'<div class="math">{formula}{number}</div>\n')
    raise nodes.SkipNode
