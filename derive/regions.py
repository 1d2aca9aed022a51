"""Open polyhedral regions of scalings, in exact integers: where some linear forms grow beyond all bounds.

A region is given by its *strict* forms, each of which grows beyond all bounds in it, at whatever rate, and by forms
that stay bounded in it, which were cut off. It is held as the generators of its closure: rays, and lines that may be
followed both ways. Another form grows on all of it if and only if it is nowhere negative on the generators and not zero
on all of them, since it is then a sum of strict forms with factors that are not negative (Farkas' lemma). So what holds
in a region holds on the whole of it, along whatever path, and not only along straight ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

from softdyn.derive.cones import Normal, Ray, dot, primitive


@dataclass(frozen=True)
class Region:
    """An open polyhedral region.

    Attributes
    ----------
    rays, lines : tuples of Ray
    strict : tuple of Normal
        Forms that grow beyond all bounds.
    """

    rays: tuple[Ray, ...]
    lines: tuple[Ray, ...]
    strict: tuple[Normal, ...] = ()

    @property
    def generators(self) -> tuple[Ray, ...]:
        """Rays whose positive hull is the closure of the region."""
        return (*self.rays, *self.lines, *(tuple(-x for x in line) for line in self.lines))

    @property
    def inner(self) -> Ray:
        """Return a direction along which every strict form grows."""
        if not self.rays:
            return (0,) * len(self.lines[0]) if self.lines else ()
        return primitive([sum(parts) for parts in zip(*self.rays, strict=True)])


def space(dimension: int) -> Region:
    """Return the whole space."""
    return Region((), tuple(tuple(int(i == j) for i in range(dimension)) for j in range(dimension)))


def cut_by(region: Region, normal: Normal) -> tuple[Region | None, Region | None, Region | None]:
    """Cut a region by a linear form.

    Returns
    -------
    above, on, below : Region or None
        Where the form grows, stays bounded, and falls; None where there is no such part.
    """
    line = next((line for line in region.lines if dot(normal, line) != 0), None)
    opposite = tuple(-x for x in normal)
    if line is not None:
        line = line if dot(normal, line) > 0 else tuple(-x for x in line)
        rays = tuple(_onto(normal, line, ray) for ray in region.rays)
        lines = tuple(_onto(normal, line, other) for other in region.lines if _differs(other, line))
        back = tuple(-x for x in line)
        return (
            Region((*rays, line), lines, (*region.strict, normal)),
            _open(Region(rays, lines, region.strict)),
            Region((*rays, back), lines, (*region.strict, opposite)),
        )
    values = {ray: dot(normal, ray) for ray in region.rays}
    on = [ray for ray, value in values.items() if value == 0]
    over, under = ([ray for ray, value in values.items() if sign * value > 0] for sign in (1, -1))
    crossing = [
        primitive([values[high] * y - values[low] * x for x, y in zip(high, low, strict=True)])
        for high in over
        for low in under
        if _adjacent(region, high, low)
    ]
    between = (*on, *crossing)
    return (
        _open(Region((*between, *over), region.lines, _with(region.strict, normal, bool(under)))) if over else None,
        _open(Region(between, region.lines, region.strict)),
        _open(Region((*between, *under), region.lines, _with(region.strict, opposite, bool(over)))) if under else None,
    )


def _with(strict: tuple[Normal, ...], normal: Normal, cuts: bool) -> tuple[Normal, ...]:
    return (*strict, normal) if cuts and normal not in strict else strict


def _differs(one: Ray, other: Ray) -> bool:
    return one != other and one != tuple(-x for x in other)


def _onto(normal: Normal, line: Ray, ray: Ray) -> Ray:
    """Move a ray along a line until a form, which grows along the line, vanishes on it."""
    slope, value = dot(normal, line), dot(normal, ray)
    return primitive([slope * x - value * y for x, y in zip(ray, line, strict=True)])


def _adjacent(region: Region, one: Ray, other: Ray) -> bool:
    """Whether two rays span an edge: no other ray lies on all the facets that both lie on."""
    tight = [normal for normal in region.strict if dot(normal, one) == 0 == dot(normal, other)]
    return not any(ray not in (one, other) and all(dot(normal, ray) == 0 for normal in tight) for ray in region.rays)


def _open(region: Region) -> Region | None:
    """Return a region, if every strict form can grow in it."""
    return region if all(any(dot(normal, ray) > 0 for ray in region.rays) for normal in region.strict) else None


def lifted(region: Region) -> Region:
    """Return a region with one dimension more, along which nothing is said."""
    unit = (*(0 for _ in _any_of(region)), 1)
    return Region(
        tuple((*ray, 0) for ray in region.rays),
        (*((*line, 0) for line in region.lines), unit),
        tuple((*normal, 0) for normal in region.strict),
    )


def _any_of(region: Region) -> Ray:
    return next(iter(region.generators), ())


def form_with(values: Sequence[int | Fraction], generators: Sequence[Ray]) -> Normal:
    """Return a linear form in whole numbers that has given values at generators, up to a positive factor."""
    return primitive(exact_form(values, generators))


def exact_form(values: Sequence[int | Fraction], generators: Sequence[Ray]) -> tuple[Fraction, ...]:
    """Return a linear form that has given values at generators."""
    rows: list[list[int | Fraction]] = [[*ray, value] for ray, value in zip(generators, values, strict=True)]
    found = [Fraction(0)] * (len(rows[0]) - 1)
    for i, row in reduced(rows):
        found[i] = row[-1]
    return tuple(found)


def reduced(rows: Sequence[Sequence[int | Fraction]]) -> Iterator[tuple[int, list[Fraction]]]:
    """Solve linear equations, the last column being their right-hand side: the pivots' columns, and their rows."""
    done = 0
    pivots = []
    left = [[Fraction(x) for x in row] for row in rows]
    for column in range(len(left[0]) - 1):
        pivot = next((k for k in range(done, len(left)) if left[k][column] != 0), None)
        if pivot is None:
            continue
        left[done], left[pivot] = left[pivot], left[done]
        left[done] = [x / left[done][column] for x in left[done]]
        for k in range(len(left)):
            if k != done and left[k][column] != 0:
                factor = left[k][column]
                left[k] = [x - factor * y for x, y in zip(left[k], left[done], strict=True)]
        pivots.append(column)
        done += 1
    if any(row[-1] != 0 for row in left[done:]):
        raise ValueError("no linear form has these values")
    return zip(pivots, left[:done], strict=True)


def combination(
    values: Sequence[int | Fraction], forms: Sequence[Sequence[int | Fraction]], most: int
) -> dict[int, Fraction] | None:
    """Write values at generators as a sum of those of some forms, with positive factors; None if that cannot be.

    Parameters
    ----------
    values : sequence of int or Fraction
    forms : sequence of such
        Those named first are taken first.
    most : int
        Forms that may be taken: the dimension of the space.

    Returns
    -------
    dict from int to Fraction
        Factors of forms, by their place.
    """
    for count in range(1, most + 1):
        for chosen in combinations(range(len(forms)), count):
            rows = [[*(forms[k][i] for k in chosen), value] for i, value in enumerate(values)]
            try:
                factors = {chosen[column]: row[-1] for column, row in reduced(rows)}
            except ValueError:
                continue
            if len(factors) == count and all(factor > 0 for factor in factors.values()):
                return factors
    return None
