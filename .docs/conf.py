"""How the site is built: ``sphinx-build .docs site``. Nothing is fetched; tutorials are run."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

import softdyn
from softdyn.derive.typeset import to_latex
from softdyn.laws import stock_closures, stock_laws, stock_potentials

project, author, version = "softdyn", "the softdyn developers", softdyn.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode, nb_execution_raise_on_error, nb_execution_timeout = "cache", True, 600
html_theme, html_title, html_math_renderer = "furo", "softdyn", "mathml"
exclude_patterns = ["scenes"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
suppress_warnings = ["myst.header", "mystnb.unknown_mime_type", "ref.python"]


def _formula(display: str) -> Callable[[Any, Any], None]:
    """Formulas as MathML, which browsers show by themselves."""

    def visit(translator: Any, node: Any) -> None:
        translator.body.append(convert(node.astext(), display=display))
        raise SkipNode

    return visit


def _stock_page() -> str:
    """All stock laws, closures and potentials, as they declare themselves."""
    lines = [
        "# Stock laws, closures and potentials",
        "",
        "Their limits are proved anew at every change: `softdyn check NAME`.",
        "",
    ]
    lines += ["## Laws", ""]
    for name in stock_laws():
        law = import_module(f"softdyn.derive.laws.{name}").law
        lines += [f"### {name}", "", law.description, "", f"$$\n{law._repr_latex_().strip('$')}\n$$", ""]
        lines += [f"Source: {law.source}", ""] if law.source else []
        lines += [f"- {limit.name}" for limit in law.limits] + [""]
    lines += ["## Closures", ""]
    for name in stock_closures():
        closure = import_module(f"softdyn.derive.closures.{name}").closure
        lines += [f"### {name}", "", f"{closure.description} Gives: {closure.gives}.", ""]
        lines += [f"Source: {closure.source}", ""] if closure.source else []
        lines += [f"- {limit.name}" for limit in closure.limits] + [""]
    lines += ["## Potentials", ""]
    for name in stock_potentials():
        potential = import_module(f"softdyn.derive.potentials.{name}").potential
        energy = to_latex(potential.energy)
        lines += [f"### {name}", "", potential.description, "", f"$$\nU = {energy}\n$$", ""]
        lines += [f"Source: {potential.source}", ""] if potential.source else []
        lines += [f"- {limit.name}" for limit in potential.limits] + [""]
    return "\n".join(lines)


def _write_pages(_: object) -> None:
    here = Path(__file__).parent
    (here / "stock_laws.md").write_text(_stock_page(), encoding="utf-8")


def setup(app: Any) -> None:
    """Connect what stands above."""
    app.add_html_math_renderer("mathml", (_formula("inline"), None), (_formula("block"), None))
    app.connect("builder-inited", _write_pages)
