"""A closure at one point of its plane: what it gives there, and how far off each regime's form is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from sympy import Rational

from softdyn.derive.closure import Closure, Re, c, densest, phi, sample_values
from softdyn.derive.closure_regimes import ClosureDiagram
from softdyn.errors import SceneError
from softdyn.study.closure_plane import errors_of, in_numbers, margins, unit_of
from softdyn.study.closure_text import written
from softdyn.words import listed, suggestion


def point_of(closure: Closure, given: Mapping[str, Rational]) -> tuple[float, float]:
    """Re and the volume fraction of the grains of a point that is given by name; what does not matter is 1, and 0.5.

    Parameters
    ----------
    closure : Closure
    given : mapping from str to Rational
        Re, and phi or c, as far as the closure depends on them.

    Raises
    ------
    SceneError
        If one is missing, given twice or of no use, or is none.
    """
    known = closure.expression.free_symbols
    needed = [name for name, those in (("Re", {Re}), ("phi", {phi, c})) if known & those]
    names = {"c": "phi"}
    faults = [
        f"--at {name}: {closure.name} is told at values of {' and '.join(needed)}{suggestion(name, needed)}"
        for name in given
        if names.get(name, name) not in needed
    ]
    faults += [
        f"--at: {name} is missing" for name in needed if not {name, *(["c"] if name == "phi" else [])} & {*given}
    ]
    if {"phi", "c"} <= {*given}:
        faults.append("--at: phi = 1 - c, give one of them")
    number = float(given.get("Re", Rational(1)))
    fraction = 1 - float(given["c"]) if "c" in given else float(given.get("phi", Rational(1, 2)))
    most = float(densest(closure).subs(sample_values(closure)))
    if not 0 < fraction < most:
        faults.append(f"--at: phi = {fraction:g} is not between 0 and {most:g}")
    if not number > 0:
        faults.append(f"--at: Re = {number:g} is not positive")
    if faults:
        raise SceneError(listed(faults))
    return number, fraction


def at_point(diagram: ClosureDiagram, number: float, fraction: float) -> dict[str, Any]:
    """What a closure gives at a point, in its unit, and its regimes' forms there.

    Parameters
    ----------
    diagram : ClosureDiagram
    number, fraction : float
        Re, and the volume fraction of the grains.

    Returns
    -------
    dict
        "Re", "phi", "value", "unit", and "regimes": of each whose case applies its "error", abs(closure/form - 1), and
        the "decades" by which its conditions hold, negative where they do not, None without conditions.
    """
    closure = diagram.closure
    here = np.array([number]), np.array([fraction])
    regimes = []
    for one in diagram.regimes:
        margin = float(margins(closure, one, *here)[0])
        if one.form is None or margin == -math.inf:
            continue
        error = float(errors_of(closure, one, *here)[0])
        regimes.append({"name": one.name, "error": error, "decades": margin if math.isfinite(margin) else None})
    unit = unit_of(closure)
    value = float(in_numbers(closure, closure.expression / unit)(*here)[0])
    return {"Re": number, "phi": fraction, "value": value, "unit": written(unit), "regimes": regimes}


def point_text(closure: Closure, found: Mapping[str, Any]) -> str:
    """The same, to read on a terminal."""
    unit = "" if found["unit"] == "1" else f" times {found['unit']}"
    lines = [f"\n  at Re = {found['Re']:g}, phi = {found['phi']:g}: {closure.gives} = {found['value']:.6g}{unit}"]
    for one in found["regimes"]:
        decades = one["decades"]
        where = "" if decades is None else f", {'inside' if decades >= 0 else 'outside'} by {abs(decades):.2g} decades"
        lines.append(f"    {one['name']}: its form is off by {100 * one['error']:.2g} %{where}")
    return "".join(line + "\n" for line in lines)
