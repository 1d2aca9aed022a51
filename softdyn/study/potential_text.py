"""What follows from a potential, as text, LaTeX or JSON."""

from __future__ import annotations

import json

from softdyn.derive.potential import F, F_r, Potential, U, dimensions_for, force_of
from softdyn.derive.soundness import sound
from softdyn.derive.typeset import to_latex
from softdyn.study.closure_text import written

SAYS = {U: "energy, as declared", F: "force that pushes the two apart, -dU/dr", F_r: "its slope, dF/dr"}
LATEX = {U: "U", F: "F", F_r: r"\mathrm{d}F/\mathrm{d}r"}


def derived_text(potential: Potential, kind: str) -> str:
    """Energy, force and its slope; ``kind`` is "text", "latex" or "json"."""
    lines = {symbol: expr if symbol == U else sound(expr) for symbol, expr in force_of(potential).items()}
    activation = potential.activation
    if kind == "json":
        units = {str(symbol): str(unit) for symbol, unit in dimensions_for(potential).items()}
        entries = [
            {"name": symbol.name, "says": SAYS[symbol], "is": str(expr), "latex": to_latex(expr)}
            for symbol, expr in lines.items()
        ]
        domain = [str(end) for end in potential.domain]
        told = {"potential": potential.name, "dimensions": units, "domain": domain, "activation": str(activation)}
        return json.dumps({**told, "derived": entries}, indent=2) + "\n"
    if kind == "latex":
        rows = [rf"% {SAYS[x]}" + "\n" + rf"\[ {LATEX[x]} = {to_latex(expr)} \]" for x, expr in lines.items()]
        return "\n".join(rows) + "\n"
    low, high = potential.domain
    beside = [f"\nholds for\n  {low} < r < {high}\n"] if (low, high) != (0, float("inf")) and str(high) != "oo" else []
    beside += [f"\na factor of all of them\n  activation = {written(activation)}\n"] if activation != 1 else []
    return f"{potential.name}: {potential.description}\n" + "".join(
        [*(f"\n{SAYS[x]}\n  {x.name} = {written(expr)}\n" for x, expr in lines.items()), *beside]
    )
