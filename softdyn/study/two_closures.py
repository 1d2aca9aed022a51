"""How far two closures are from each other, over the plane of Re and volume fraction.

Both are evaluated at the points of a table, their own parameters at typical values. Where both have leading forms in
one region of the plane, the ratio of these is exact. A drag and a permeability are compared as permeabilities, that of
a bed of grains with the drag.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, powsimp

from softdyn.derive.asymptotics import is_small
from softdyn.derive.closure import Closure, Re, in_fractions
from softdyn.derive.closure_dynamics import permeability_of_drag
from softdyn.derive.closure_regimes import ClosureRegime, discover_closure, in_words
from softdyn.derive.limits import simplified
from softdyn.errors import SceneError
from softdyn.study.closure_plane import fractions_of, in_numbers, margins, points
from softdyn.study.closure_text import case_text, written
from softdyn.study.two_laws import WITHIN

#: Re and volume fractions of the grains at which two closures are compared.
NUMBERS = (1e-3, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e6)
FRACTIONS = (0.001, 0.01, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
#: Points along each side of the plane where regions of both are looked for.
POINTS = 121


@dataclass(frozen=True)
class SharedRegion:
    """A region of the plane in which both closures have leading forms.

    Attributes
    ----------
    first, second : str
        The regimes' names.
    conditions : tuple of str
        What holds in both.
    ratio : str
        first/second: exact to leading order.
    low, high : float
        Between what that lies there, at the points that were looked at.
    """

    first: str
    second: str
    conditions: tuple[str, ...]
    ratio: str
    low: float
    high: float


@dataclass(frozen=True)
class ClosureComparison:
    """Ratios first/second of what two closures give.

    Attributes
    ----------
    first, second : str
    gives : str
        What is compared.
    numbers, fractions : tuple of float
        Re, and phi.
    ratios : tuple of rows, one for each fraction, of one ratio for each Re
        None where one of the closures has no such value.
    regions : tuple of SharedRegion
    """

    first: str
    second: str
    gives: str
    numbers: tuple[float, ...]
    fractions: tuple[float, ...]
    ratios: tuple[tuple[float | None, ...], ...]
    regions: tuple[SharedRegion, ...]

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return asdict(self)

    def text(self) -> str:
        """Return a table of the ratios."""
        return "\n".join(_lines(self)) + "\n"


def compare_closures(first: Closure, second: Closure) -> ClosureComparison:
    """Compare two closures over the plane of Re and volume fraction.

    Raises
    ------
    SceneError
        If they give different things, or a parameter of one name has different typical values.
    """
    gives, compared = _quantities(first, second)
    high = min(fractions_of(one)[1] for one in (first, second))
    fractions = tuple(x for x in FRACTIONS if x < high)
    by_number = any(in_fractions(one, expr).has(Re) for one, expr in zip((first, second), compared, strict=True))
    numbers = NUMBERS if by_number else (1.0,)
    X, Y = np.meshgrid(numbers, fractions)
    values = [
        np.asarray(in_numbers(one, expr)(X, Y), float) for one, expr in zip((first, second), compared, strict=True)
    ]
    with np.errstate(all="ignore"):
        ratios = values[0] / values[1]
    rows = tuple(tuple(float(x) if math.isfinite(x) else None for x in row) for row in ratios)
    regions = tuple(_regions(first, second, high))
    return ClosureComparison(first.name, second.name, gives, numbers, fractions, rows, regions)


def _quantities(first: Closure, second: Closure) -> tuple[str, tuple[Expr, Expr]]:
    """What two closures are compared by."""
    given = {first.gives, second.gives}
    typical = [{symbol.name: value for symbol, value in closure.typical.items()} for closure in (first, second)]
    for name in sorted(typical[0].keys() & typical[1].keys()):
        if typical[0][name] != typical[1][name]:
            raise SceneError(
                f"compare: {name} is {typical[0][name]} in {first.name}, and {typical[1][name]} in {second.name}; "
                "give both one typical value"
            )
    if given == {"drag", "permeability"}:
        return "permeability", (_permeability(first, first.expression), _permeability(second, second.expression))
    if len(given) > 1:
        raise SceneError(f"compare: {first.name} gives {first.gives}, and {second.name} gives {second.gives}")
    return first.gives, (first.expression, second.expression)


def _permeability(closure: Closure, form: Expr) -> Expr:
    return permeability_of_drag(form) if closure.gives == "drag" else form


def _regions(first: Closure, second: Closure, high: float) -> Iterator[SharedRegion]:
    """Regions of the plane that a regime of one closure shares with one of the other."""
    mixed = first.gives != second.gives
    numbers, grains = points(first, POINTS)
    keep = grains < high
    found = [
        [(closure, regime, _far_within(closure, regime, numbers, grains) & keep) for regime in regimes]
        for closure, regimes in ((one, discover_closure(one).regimes) for one in (first, second))
    ]
    for (_, one, here), (_, other, there) in itertools.product(*found):
        both = here & there
        if not both.any() or one.form is None or other.form is None:
            continue
        forms = [
            _permeability(closure, regime.form.state) if mixed and regime.form else regime.form.state
            for closure, regime in ((first, one), (second, other))
            if regime.form
        ]
        values = [
            np.asarray(in_numbers(closure, form)(numbers, grains), float)[both]
            for closure, form in zip((first, second), forms, strict=True)
        ]
        ratio = values[0] / values[1]
        exact = powsimp(forms[0] / forms[1])
        shown = in_words(simplified(exact) if is_small(exact) else exact)
        yield SharedRegion(
            one.name, other.name, _conditions((one, other)), written(shown), float(ratio.min()), float(ratio.max())
        )


def _conditions(regimes: Sequence[ClosureRegime]) -> tuple[str, ...]:
    found = dict.fromkeys(f"{written(x.small)} << {written(x.large)}" for one in regimes for x in one.conditions)
    cases = dict.fromkeys(text for one in regimes if (text := case_text(one.case)))
    return (*found, *cases)


def _far_within(
    closure: Closure, regime: ClosureRegime, numbers: NDArray[np.float64], grains: NDArray[np.float64]
) -> NDArray[np.bool_]:
    return margins(closure, regime, numbers, grains) >= -math.log10(WITHIN)


def _lines(comparison: ClosureComparison) -> Iterator[str]:
    yield f"{comparison.first}/{comparison.second}: {comparison.gives}"
    yield ""
    by_number = len(comparison.numbers) > 1
    yield f"{'phi':>7} |" + (
        " Re = " + " ".join(f"{number:<8g}" for number in comparison.numbers).rstrip() if by_number else ""
    )
    for fraction, row in zip(comparison.fractions, comparison.ratios, strict=True):
        cells = (f"{'-':8}" if value is None else f"{value:<8.4g}" for value in row)
        yield f"{fraction:7g} |{' ' * 6 if by_number else ' '}" + " ".join(cells).rstrip()
    if comparison.regions:
        yield ""
        yield "exact ratios of the leading forms"
    for region in comparison.regions:
        same = region.first if region.first == region.second else ""
        names = same or f"{comparison.first} {region.first}, {comparison.second} {region.second}"
        where = f": {', '.join(region.conditions)}" if region.conditions else ""
        alike = math.isclose(region.low, region.high, rel_tol=1e-9)
        span = f"{region.low:.4g}" if alike else f"{region.low:.4g} to {region.high:.4g}"
        yield f"  {names}{where}"
        yield f"    {region.ratio}  ({span} there)"
