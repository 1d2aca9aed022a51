"""What follows from a potential, as text, LaTeX or JSON."""

from __future__ import annotations

import json
from math import inf
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from sympy import Expr, S, lambdify

from softdyn.derive.potential import F, F_r, Potential, U, contact, dimensions_for, force_of, r
from softdyn.derive.soundness import sound
from softdyn.derive.typeset import to_latex
from softdyn.study.closure_text import written

SAYS = {U: "energy, as declared", F: "force that pushes the two apart, -dU/dr", F_r: "its slope, dF/dr"}
LATEX = {U: "U", F: "F", F_r: r"\mathrm{d}F/\mathrm{d}r"}

#: Distances at which what a potential does is looked for, in units of the largest length of its typical values.
SPAN = np.geomspace(1e-3, 1e3, 6001)


def at_typical_values(potential: Potential) -> dict[str, float]:
    """What somebody asks first: where two particles rest, how stiff they are there, and what pulls them apart.

    At the potential's typical values; without those of all parameters, or without such a distance, there is nothing.

    Returns
    -------
    dict
        ``rest``, where F falls through 0, the farthest; ``stiffness``, -dF/dr there; ``pull_off``, the largest force
        that holds them, and ``pulled_to``, where it is: neither, if the hold grows up to the end of the domain.
    """
    if potential.parameters.keys() - potential.typical.keys() or potential.energy.has(contact):
        return {}
    values = {symbol: S(value) for symbol, value in potential.typical.items()}
    lengths = [
        float(value) for symbol, value in values.items() if potential.parameters[symbol] == dimensions_for(potential)[r]
    ]
    low, high = (float(S(end).subs(values)) for end in potential.domain)
    force, slope = (_numbers(force_of(potential)[x].subs(values)) for x in (F, F_r))
    at = SPAN * max(lengths, default=1.0)
    # a grid within the domain, finer towards its ends
    inner = low + (high - low) * (1 - np.cos(np.linspace(0, np.pi, 2001)[1:-1])) / 2 if high < inf else at
    at = np.unique(np.concatenate([at[(at > low) & (at < high)], inner[inner > 0]]))
    pushes = np.array([force(x) for x in at])
    falls = np.flatnonzero((pushes[:-1] > 0) & (pushes[1:] <= 0))
    if not len(falls):
        return {}
    i = int(falls[-1])
    rest = float(brentq(force, at[i], at[i + 1], xtol=1e-14 * at[i], rtol=1e-15))
    found = {"rest": rest, "stiffness": -slope(rest)}
    least = i + 1 + int(np.argmin(pushes[i + 1 :]))
    if least < len(at) - 1:
        hold = minimize_scalar(
            force, bounds=(max(rest, at[least - 1]), at[least + 1]), method="bounded", options={"xatol": 1e-9 * rest}
        )
        found |= {"pull_off": -float(hold.fun), "pulled_to": float(hold.x)}
    return found


def _numbers(expr: Expr) -> Any:
    evaluate = lambdify(r, expr, "math")

    def of(x: float) -> float:
        try:
            return float(evaluate(x))
        except OverflowError:
            return inf

    return of


def _asked_first(potential: Potential) -> list[str]:
    found = at_typical_values(potential)
    if not found:
        return []
    values = ", ".join(f"{symbol} = {value}" for symbol, value in potential.typical.items())
    lines = [f"  two rest at r = {found['rest']:.6g}, where their stiffness -dF/dr is {found['stiffness']:.6g}"]
    if "pull_off" in found:
        lines.append(f"  {found['pull_off']:.6g} pulls them apart, at r = {found['pulled_to']:.6g}")
    return [f"\nat its typical values, {values}\n" + "\n".join(lines) + "\n"]


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
        [
            *(f"\n{SAYS[x]}\n  {x.name} = {written(expr)}\n" for x, expr in lines.items()),
            *beside,
            *_asked_first(potential),
        ]
    )
