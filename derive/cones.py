"""Polyhedral cones of scalings, in exact integers.

A scaling sends each length and each parameter of a law to a power of one small eps; its exponents are a point of a
space with one axis for each of them. What holds for a scaling holds for its multiples, so regions are cones. A
*simplicial* cone is held as its rays: as many integer vectors as it has dimensions, of which it is the positive hull.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from itertools import combinations, product
from math import gcd, lcm

Ray = tuple[int, ...]
Cone = tuple[Ray, ...]
Normal = tuple[int, ...]


def primitive(vector: Sequence[int | Fraction]) -> Ray:
    """Return the shortest integer vector in a direction."""
    scale = lcm(*(Fraction(x).denominator for x in vector))
    whole = [int(x * scale) for x in vector]
    common = gcd(*whole) or 1
    return tuple(x // common for x in whole)


def dot(one: Sequence[int], other: Sequence[int]) -> int:
    """Scalar product."""
    return sum(x * y for x, y in zip(one, other, strict=True))


def orthants(dimension: int, positive: Iterable[int] = ()) -> list[Cone]:
    """Return the simplicial cones between the axes, which cover the space; the axes named only where positive."""
    held = set(positive)
    sides = product(*((1,) if axis in held else (1, -1) for axis in range(dimension)))
    return [
        tuple(tuple(side if i == axis else 0 for i in range(dimension)) for axis, side in enumerate(signs))
        for signs in sides
    ]


def split(cone: Cone, values: Sequence[int | Fraction]) -> tuple[list[Cone], list[Cone]]:
    """Cut a simplicial cone by the hyperplane on which a linear form vanishes.

    Parameters
    ----------
    cone : Cone
    values : sequence of int or Fraction
        The form at each ray of the cone.

    Returns
    -------
    above, below : lists of Cone
        Simplicial cones that fill the two sides; one list is empty if the hyperplane does not cut the cone.
    """
    high = next((i for i, value in enumerate(values) if value > 0), None)
    low = next((i for i, value in enumerate(values) if value < 0), None)
    if low is None or high is None:
        return ([cone], []) if low is None else ([], [cone])
    # a new ray on the hyperplane, in the place of one end of an edge that crosses it, then of the other
    crossing = primitive([values[high] * y - values[low] * x for x, y in zip(cone[high], cone[low], strict=True)])
    above: list[Cone] = []
    below: list[Cone] = []
    for end in (low, high):
        part = (*cone[:end], crossing, *cone[end + 1 :])
        over, under = split(part, [0 if i == end else value for i, value in enumerate(values)])
        above += over
        below += under
    return above, below


def facets(cones: Iterable[Cone]) -> list[Cone]:
    """Return the facets of simplicial cones, each once: all rays but one."""
    found = {frozenset(facet): facet for cone in cones for i in range(len(cone)) if (facet := cone[:i] + cone[i + 1 :])}
    return list(found.values())


def cut(cones: Iterable[Cone], normals: Iterable[Normal]) -> list[Cone]:
    """Return the part of some simplicial cones where every normal has a product that is not negative.

    Cones that only touch that region from outside, in fewer dimensions, are left out.
    """
    kept = list(cones)
    for normal in normals:
        kept = [
            part
            for cone in kept
            for part in split(cone, [dot(normal, ray) for ray in cone])[0]
            if any(dot(normal, ray) > 0 for ray in part)
        ]
    return kept


@lru_cache(maxsize=10_000)
def normals(cone: Cone) -> tuple[Normal, ...]:
    """Return the inward normals of the facets of a simplicial cone of full dimension, each opposite to a ray."""
    size = len(cone)
    # rows of the inverse of the matrix whose columns are the rays, by elimination
    matrix = [[Fraction(ray[i]) for ray in cone] + [Fraction(int(i == j)) for j in range(size)] for i in range(size)]
    for i in range(size):
        pivot = next(k for k in range(i, size) if matrix[k][i] != 0)
        matrix[i], matrix[pivot] = matrix[pivot], matrix[i]
        matrix[i] = [x / matrix[i][i] for x in matrix[i]]
        for k in range(size):
            if k != i and matrix[k][i] != 0:
                factor = matrix[k][i]
                matrix[k] = [x - factor * y for x, y in zip(matrix[k], matrix[i], strict=True)]
    return tuple(primitive(row[size:]) for row in matrix)


def hull_normals(cones: Sequence[Cone]) -> list[Normal]:
    """Return the facet normals that no ray of the cones lies behind: those of their union, if it is convex."""
    rays = {ray for cone in cones for ray in cone}
    candidates = dict.fromkeys(normal for cone in cones for normal in normals(cone))
    return [normal for normal in candidates if all(dot(normal, ray) >= 0 for ray in rays)]


def merged(groups: Sequence[tuple[list[Cone], object]]) -> list[tuple[list[Cone], object]]:
    """Join cones that carry equal labels into convex regions, as few as a greedy search finds.

    Two groups are joined if the hull of their union meets no cone of any other group.
    """
    parts = list(groups)
    progress = True
    while progress:
        progress = False
        for i, (cones, label) in enumerate(parts):
            for j in range(i + 1, len(parts)):
                if parts[j][1] != label:
                    continue
                union = cones + parts[j][0]
                facets = hull_normals(union)
                others = (part for k, (part, _) in enumerate(parts) if k not in (i, j))
                if not any(cut(part, facets) for part in others):
                    parts[i] = (union, label)
                    del parts[j]
                    progress = True
                    break
            if progress:
                break
    return parts


def simpler(cones: Sequence[Cone]) -> list[Cone]:
    """Fill a convex region with fewer simplicial cones: pairs that make up one are joined."""
    parts = list(cones)
    for one, other in combinations(parts, 2):
        facets = hull_normals([one, other])
        rays = dict.fromkeys(ray for ray in (*one, *other))
        # a ray is an edge if as many facets meet in it as leave one direction free
        edges = tuple(ray for ray in rays if sum(dot(facet, ray) == 0 for facet in facets) >= len(one) - 1)
        rest = [cone for cone in parts if cone not in (one, other)]
        if len(edges) == len(one) == len(facets) and not cut(rest, facets):
            return simpler([*rest, edges])
    return parts


def shared_facets(one: Sequence[Cone], other: Sequence[Cone]) -> list[Normal]:
    """Return the normals, pointing into the first region, of the facets along which two convex regions touch."""
    found = []
    behind = hull_normals(other)
    for normal in hull_normals(one):
        opposite = tuple(-x for x in normal)
        if opposite not in behind:
            continue
        facets = [
            tuple(ray for ray in cone if dot(normal, ray) == 0)
            for cone in one
            if sum(dot(normal, ray) == 0 for ray in cone) == len(cone) - 1
        ]
        if cut(facets, [facet for facet in behind if facet != opposite]):
            found.append(normal)
    return found
