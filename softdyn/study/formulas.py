"""Formulas as MathML, made from the LaTeX of :mod:`softdyn.derive.typeset`.

Browsers set MathML by themselves: no script and no picture, and what is selected is text. No browser breaks its lines,
so a formula comes in pieces, cut where a line may end.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from functools import cache
from html import escape
from typing import NamedTuple

#: A line may end before these; before a factor only where a piece is too wide for a line of a telephone.
SIGNS = ("=", r"\simeq", r"\ll", r"\gg", r"\to", "+", "-")
FACTOR = " "
#: Width, in the font's size, beyond which a piece is cut between factors.
WIDE = 18.0
#: Width, in the font's size, of a line on paper: what is wider is set smaller there.
PAPER = 44.0
#: Fractions within so many others are still of full size.
NESTED = 1
SMALLER = 0.72

WORD = r"\\(?:mathrm|operatorname|text)\{(?:\\.|[^{}\\])*\}"
TOKEN = re.compile(WORD + r"|\\[a-zA-Z]+|\\.|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
RELATIONS = {
    "=": "=", "<": "<", ">": ">", r"\simeq": "≃", r"\ll": "≪", r"\gg": "≫", r"\to": "→",
    r"\leq": "≤", r"\geq": "≥", r"\le": "≤", r"\ge": "≥", r"\neq": "≠", r"\sim": "∼",
}  # fmt: skip
BETWEEN = {"+": "+", "-": "−", r"\pm": "±", r"\cdot": "⋅", r"\times": "×", r"\wedge": "∧", r"\vee": "∨"}
SPACES = {r"\,": 0.17, r"\:": 0.22, r"\;": 0.28, r"\ ": 0.3, r"\!": 0.0, r"\quad": 1.0}
OPENING, CLOSING = {"(": "(", "[": "[", r"\{": "{"}, {")": ")", "]": "]", r"\}": "}"}
MARKS = {",": ",", ";": ";", r"\ldots": "…", r"\dots": "…", "/": "/", "!": "!", ".": ".", ":": ":"}
LETTERS = {
    r"\ell": "ℓ", r"\infty": "∞", r"\lambda": "λ", r"\Lambda": "Λ", r"\epsilon": "ϵ", r"\varepsilon": "ε",
    r"\phi": "ϕ", r"\varphi": "φ", r"\vartheta": "ϑ", r"\varrho": "ϱ", r"\varpi": "ϖ", r"\varsigma": "ς",
    r"\partial": "∂", r"\hbar": "ℏ",
}  # fmt: skip
ACCENTS = {r"\dot": "˙", r"\ddot": "¨", r"\hat": "^", r"\bar": "¯", r"\tilde": "~", r"\vec": "→"}
FUNCTIONS = frozenset(
    "sin cos tan cot sec csc sinh cosh tanh coth arcsin arccos arctan exp ln log min max sup inf".split()
)


#: A line does not end after these.
NOT_AFTER = frozenset(("", "(", "^", "_", "/", r"\int", r"\frac", r"\left", r"\right", *RELATIONS, *BETWEEN))


class Set(NamedTuple):
    """What is set: its MathML, its width in the font's size, and what it does to the space around it."""

    markup: str
    width: float
    kind: str = "letter"


def formula(latex: str, text: str) -> str:
    """HTML of a formula.

    Parameters
    ----------
    latex : str
        As of :mod:`softdyn.derive.typeset`.
    text : str
        What a screen reader says; shown instead of LaTeX that is not known here.
    """
    try:
        parts = [_set(piece, i > 0) for i, piece in enumerate(pieces(latex))]
    except ValueError:
        return f'<code class="formula">{escape(text)}</code>'
    widest = max(part.width for part in parts)
    fits = f' style="--fit:{PAPER / widest:.2f}"' if widest > PAPER else ""
    # a line may end where there is a <wbr>
    inner = "<wbr>".join(f'<math displaystyle="true">{part.markup}</math>' for part in parts)
    return f'<span class="formula" role="math" aria-label="{escape(text)}"{fits}>{inner}</span>'


def pieces(latex: str) -> list[str]:
    """Pieces of a formula, each to stand on a line of its own if need be.

    Raises
    ------
    ValueError
        If there is LaTeX in it that is not known here.
    """
    return [
        part
        for piece in cut(latex, SIGNS)
        for part in ([piece] if _set(piece).width <= WIDE else cut(piece, (FACTOR, r"\,")))
    ]


def widest(latex: str) -> float:
    """Width of a formula's widest piece, in the font's size, to a tenth or so; infinite if it cannot be set."""
    try:
        return max(_set(piece).width for piece in pieces(latex))
    except ValueError:
        return math.inf


def cut(latex: str, before: Sequence[str]) -> list[str]:
    """Cut a formula before some of its tokens, where they are in no group, and stand between two things."""
    parts, depth, last = [""], 0, ""
    for token in TOKEN.findall(latex):
        between = last not in NOT_AFTER and last[1:] not in FUNCTIONS
        if depth == 0 and token in before and between:
            parts.append("")
        depth += (token in ("{", r"\left", "(")) - (token in ("}", r"\right", ")"))
        # a bracket that \left begins is counted with it
        depth -= (last == r"\left" and token == "(") - (last == r"\right" and token == ")")
        parts[-1] += token
        last = last if token.isspace() and token not in before else token
    return [part for part in map(str.strip, parts) if part]


# ------------------------------------------------------------------------------------------------- LaTeX to MathML


@cache
def _set(latex: str, goes_on: bool = False) -> Set:
    """A piece of a formula; ``goes_on`` if there is one before it, so that a sign it begins with stands between."""
    tokens = [token for token in TOKEN.findall(latex) if not token.isspace()]
    tokens.reverse()
    whole = _row(tokens, (), 0, "letter" if goes_on else "start")
    if tokens:
        raise ValueError(f"{tokens[-1]} closes nothing")
    return whole


def _row(tokens: list[str], ends: Sequence[str], depth: int, before: str = "start") -> Set:
    """All up to one of ``ends``, which is left, or to the last token.

    Parameters
    ----------
    tokens : list of str
        In reverse; those that are set are taken away.
    ends : sequence of str
    depth : int
        How many fractions this is in.
    before : str
        Kind of what stands before it.
    """
    parts: list[Set] = []
    while tokens and tokens[-1] not in ends:
        parts.append(_with_scripts(tokens, depth, parts[-1].kind if parts else before))
    if ends and not tokens:
        raise ValueError(f"{ends[0]} is missing")
    text, width = "", 0.0
    for last, part in zip((None, *parts), parts, strict=False):
        apart = last is not None and _apart(last.kind, part.kind)
        text += ('<mspace width=".17em"/>' if apart else "") + part.markup
        width += part.width + 0.17 * apart
    return Set(parts[0].markup if len(parts) == 1 else f"<mrow>{text}</mrow>", width, "row")


def _apart(before: str, after: str) -> bool:
    """Whether a thin space parts two things: functions stand apart, but for brackets after them."""
    if after == "function":
        return before in ("letter", "number", "fraction", "close", "function")
    return before == "function" and after in ("letter", "number", "fraction", "function")


def _with_scripts(tokens: list[str], depth: int, before: str) -> Set:
    base = _one(tokens, depth, before)
    scripts: dict[str, Set] = {}
    while tokens and tokens[-1] in ("^", "_", "'"):
        mark = tokens.pop()
        if mark == "'":
            found, mark = Set("<mo>′</mo>", 0.3), "^"
        else:
            found = _argument(tokens, NESTED + 1)
        if mark in scripts:
            raise ValueError(f"two of {mark}")
        scripts[mark] = found
    if not scripts:
        return base
    tag = "msubsup" if len(scripts) == 2 else "msub" if "_" in scripts else "msup"
    inner = "".join(scripts[mark].markup for mark in ("_", "^") if mark in scripts)
    wide = SMALLER * max(script.width for script in scripts.values())
    # a row that is a base keeps its closing bracket next to the exponent
    return Set(f"<{tag}>{base.markup}{inner}</{tag}>", base.width + wide, base.kind)


def _one(tokens: list[str], depth: int, before: str) -> Set:
    """One thing, without exponents and indices.

    Parameters
    ----------
    tokens : list of str
        In reverse; those that are set are taken away.
    depth : int
        How many fractions this is in.
    before : str
        Kind of what stands before it.
    """
    token = tokens.pop() if tokens else ""
    if token == "{":
        inner = _row(tokens, ("}",), depth)
        tokens.pop()
        return inner._replace(kind="letter")
    if token == r"\frac":
        return _fraction(tokens, depth)
    if token == r"\sqrt":
        return _root(tokens, depth)
    if token == r"\left":
        return _enclosed(tokens, depth)
    if token in ACCENTS:
        base = _argument(tokens, depth)
        over = f'<mo stretchy="false">{ACCENTS[token]}</mo>'
        return Set(f'<mover accent="true">{base.markup}{over}</mover>', base.width)
    if re.fullmatch(WORD, token):
        return _word(re.sub(r"\\(.)", r"\1", token[token.index("{") + 1 : -1]))
    if token in RELATIONS or token in BETWEEN:
        return _operator(token, before)
    if token in SPACES:
        return Set(f'<mspace width="{SPACES[token]}em"/>', SPACES[token], "space")
    if token in OPENING:
        return Set(f'<mo form="prefix" stretchy="false">{OPENING[token]}</mo>', 0.35, "open")
    if token in CLOSING:
        return Set(f'<mo form="postfix" stretchy="false">{CLOSING[token]}</mo>', 0.35, "close")
    if token == "|":
        form = "prefix" if before in ("start", "operator", "open", "space", "mark") else "postfix"
        kind = "open" if form == "prefix" else "close"
        return Set(f'<mo form="{form}" stretchy="false">|</mo>', 0.25, kind)
    if token in MARKS:
        mark = f'<mo lspace="0" rspace="{0.17 * (token in (",", ";"))}em">{MARKS[token]}</mo>'
        return Set(mark, 1.0 if "dots" in token else 0.4, "mark")
    if token == r"\int":
        return Set("<mo>∫</mo>", 0.8, "operator")
    if token[:1].isdigit():
        return Set(f"<mn>{token}</mn>", 0.5 * len(token), "number")
    if token[1:] in FUNCTIONS and token[0] == "\\":
        return Set(f"<mi>{token[1:]}</mi>", 0.47 * len(token[1:]), "function")
    return _letter(token)


def _letter(token: str) -> Set:
    letter = LETTERS.get(token, token)
    if letter[:1] == "\\":
        size = "CAPITAL" if token[1].isupper() else "SMALL"
        try:
            letter = unicodedata.lookup(f"GREEK {size} LETTER {token[1:].upper()}")
        except KeyError:
            raise ValueError(f"{token} is not known here") from None
    if len(letter) != 1 or not (letter.isalpha() or letter in "∞∂"):
        raise ValueError(f"{letter!r} is not known here")
    # capitals of Greek stand upright, as in LaTeX
    upright = ' mathvariant="normal"' if "Α" <= letter <= "Ω" or letter == "∞" else ""
    return Set(f"<mi{upright}>{letter}</mi>", 0.9 if letter in "∞mMwW" else 0.62 if letter.isupper() else 0.52)


def _operator(token: str, before: str) -> Set:
    sign = escape(RELATIONS.get(token) or BETWEEN[token])
    if token in ("+", "-") and before in ("operator", "open", "mark", "space", "start"):
        # the sign of what follows stands close to it
        return Set(f'<mo form="prefix">{sign}</mo>', 0.7, "sign")
    return Set(f'<mo form="infix">{sign}</mo>', 1.25 if token != r"\cdot" else 0.7, "operator")


def _fraction(tokens: list[str], depth: int) -> Set:
    above, below = _argument(tokens, depth + 1), _argument(tokens, depth + 1)
    full = depth <= NESTED
    # within a fraction the next ones are set small, if they are not told otherwise
    style = ' displaystyle="true"' if full and depth else ""
    width = max(above.width, below.width) * (1.0 if full else SMALLER) + 0.2
    return Set(f"<mfrac{style}>{above.markup}{below.markup}</mfrac>", width, "fraction")


def _root(tokens: list[str], depth: int) -> Set:
    index = ""
    if tokens and tokens[-1] == "[":
        tokens.pop()
        index = _row(tokens, ("]",), depth).markup
        tokens.pop()
    base = _argument(tokens, depth)
    text = f"<mroot>{base.markup}{index}</mroot>" if index else f"<msqrt>{base.markup}</msqrt>"
    return Set(text, base.width + 0.9, "letter")


def _enclosed(tokens: list[str], depth: int) -> Set:
    """What stands between brackets that grow with it; those of the first size stand closer."""
    left = _bracket(tokens)
    inner = _row(tokens, (r"\right",), depth)
    tokens.pop()
    right = _bracket(tokens)
    grows = "true" if any(tag in inner.markup for tag in ("<mfrac", "<msqrt", "<mroot")) else "false"
    opening = f'<mo form="prefix" stretchy="{grows}">{left}</mo>'
    closing = f'<mo form="postfix" stretchy="{grows}">{right}</mo>'
    return Set(f"<mrow>{opening}{inner.markup}{closing}</mrow>", inner.width + 0.8, "close")


def _bracket(tokens: list[str]) -> str:
    token = tokens.pop() if tokens else ""
    sign = {**OPENING, **CLOSING, "|": "|"}.get(token)
    if sign is None:
        raise ValueError(f"{token!r} is no bracket")
    return sign


def _argument(tokens: list[str], depth: int) -> Set:
    """What a command takes: a group, or one thing; always a single element."""
    return _one(tokens, depth, "start")


def _word(word: str) -> Set:
    upright = ' mathvariant="normal"' if len(word) == 1 else ""
    return Set(f"<mi{upright}>{escape(word)}</mi>", 0.5 * len(word), "function" if len(word) > 1 else "letter")
