"""Formulas as inline SVG: LaTeX set by mathtext, drawn as outlines.

They look the same in every browser and on paper, with no network, no script and none of the reader's fonts; MathML
does not, where no mathematical font is installed. A formula comes in pieces, cut where a line may end.
"""

from __future__ import annotations

import math
import re
from collections.abc import MutableMapping, Sequence
from functools import cache
from html import escape
from typing import Any

from matplotlib import rc_context
from matplotlib.font_manager import FontProperties
from matplotlib.path import Path
from matplotlib.textpath import TextToPath

#: Outlines are in hundredths of the font's size.
EM = 100
FONT = "stix"
#: Kept free above and below.
MARGIN = 8
#: Letters of SVG paths, and how many points each takes.
LETTERS = {
    int(Path.MOVETO): ("M", 1),
    int(Path.LINETO): ("L", 1),
    int(Path.CURVE3): ("Q", 2),
    int(Path.CURVE4): ("C", 3),
}
#: Fractions within so many others are still of full size.
NESTED = 1
#: A line may end before these; before a factor only where a piece is too wide for any line.
SIGNS = (" = ", r" \simeq ", r" \ll ", r" \gg ", r" \to ", " + ", " - ")
FACTOR = " "
#: Width, in the font's size, beyond which a piece is cut between factors.
WIDE = 40.0
#: A minus that is the sign of what follows, and stands close to it.
SIGNED = re.compile(r"((?:^|= |\\[a-z]+ |\())-")
TOKEN = re.compile("|".join(map(re.escape, SIGNS)) + r"|\\[a-zA-Z]+|\\.|.", re.DOTALL)


def formula(latex: str, text: str, glyphs: MutableMapping[str, str]) -> str:
    """HTML of a formula.

    Parameters
    ----------
    latex : str
        As of :mod:`softdyn.derive.typeset`.
    text : str
        What a screen reader says; shown instead where mathtext cannot set the LaTeX.
    glyphs : mapping from str to str
        Outlines by identifier; those that the formula needs are added, for :func:`definitions`.
    """
    try:
        drawn = [_drawn(piece) for piece in pieces(latex)]
    except ValueError:
        return f'<code class="formula">{escape(text)}</code>'
    for _, used in drawn:
        glyphs.update(used)
    images = "".join(image for image, _ in drawn)
    return f'<span class="formula" role="img" aria-label="{escape(text)}">{images}</span>'


def definitions(glyphs: MutableMapping[str, str]) -> str:
    """HTML that defines the outlines which a page's formulas share."""
    paths = "\n".join(f'<path id="{name}" d="{glyphs[name]}"/>' for name in sorted(glyphs))
    return f'<svg width="0" height="0" aria-hidden="true" style="position: absolute"><defs>\n{paths}\n</defs></svg>'


def pieces(latex: str) -> list[str]:
    """Pieces of a formula, each to stand on a line of its own if need be.

    Raises
    ------
    ValueError
        If mathtext cannot set it.
    """
    whole = SIGNED.sub(r"\1{-}", displayed(latex))
    return [
        part for piece in cut(whole, SIGNS) for part in ([piece] if width(piece) <= WIDE else cut(piece, (FACTOR,)))
    ]


def widest(latex: str) -> float:
    """Width of a formula's widest piece, in the font's size; infinite if mathtext cannot set it."""
    try:
        return max(width(piece) for piece in pieces(latex))
    except ValueError:
        return math.inf


def cut(latex: str, before: Sequence[str]) -> list[str]:
    """Cut a formula before some of its tokens, where they are in no group."""
    parts, depth = [""], 0
    for token in TOKEN.findall(latex):
        if depth == 0 and token in before and parts[-1].strip():
            # after an empty group, a sign is one between terms
            parts.append("{}")
        depth += (token in ("{", r"\left")) - (token in ("}", r"\right"))
        parts[-1] += token
    return parts


def displayed(latex: str) -> str:
    """Fractions in full size, but for those deep within others, in exponents and subscripts."""
    text, outer = "", []
    depth, groups, deeper = 0, 0, 0
    for token in TOKEN.findall(latex):
        if token == "{":
            outer.append((depth, max(groups - 1, 0), deeper))
            depth, groups, deeper = depth + deeper * (groups > 0), 0, 0
        elif token == "}":
            depth, groups, deeper = outer.pop()
        elif token == r"\frac":
            token, groups, deeper = r"\dfrac" if depth <= NESTED else token, 2, 1
        elif token in ("^", "_"):
            groups, deeper = 1, NESTED + 1
        elif token != " ":
            groups = 0
        text += token
    return text


def width(latex: str) -> float:
    """Width of a formula in the font's size."""
    return _measured(latex)[0] / EM


@cache
def _measured(latex: str) -> tuple[float, float, float]:
    with rc_context({"mathtext.fontset": FONT}):
        return TextToPath().get_text_width_height_descent(f"${latex}$", FontProperties(size=EM), ismath=True)


@cache
def _drawn(latex: str) -> tuple[str, dict[str, str]]:
    """SVG of a piece, and the outlines that it uses."""
    wide, high, depth = _measured(latex)
    with rc_context({"mathtext.fontset": FONT}):
        placed, outlines, bars = TextToPath().get_glyphs_mathtext(FontProperties(size=EM), f"${latex}$")
    shapes = [
        f'<use href="#{identifier}" transform="translate({x:.5g} {y:.5g}) scale({size:.4g})"/>'
        for identifier, x, y, size in placed
    ]
    shapes += [f'<path d="{_path(*bar)}"/>' for bar in bars]
    high, depth = high + 2 * MARGIN, depth + MARGIN
    style = f"width:{wide / EM:.4g}em; height:{high / EM:.4g}em; vertical-align:{-depth / EM:.4g}em"
    image = (
        f'<svg viewBox="0 0 {wide:.5g} {high:.5g}" style="{style}" aria-hidden="true">'
        f'<g transform="translate(0 {high - depth:.5g}) scale(1 -1)">{"".join(shapes)}</g></svg>'
    )
    return image, {name: _path(*outline) for name, outline in outlines.items()}


def _path(points: Any, codes: Any) -> str:
    """Data of an SVG path."""
    text, at = [], 0
    while at < len(codes):
        if codes[at] == Path.CLOSEPOLY:
            text.append("Z")
            at += 1
            continue
        letter, count = LETTERS[int(codes[at])]
        text.append(letter + " ".join(f"{float(x):.5g} {float(y):.5g}" for x, y in points[at : at + count]))
        at += count
    return "".join(text)
