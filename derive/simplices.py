"""Shape functions on simplices, and rules of quadrature on them and on their facets: segments, triangles, tetrahedra.

Places in a simplex are told by barycentric coordinates lambda_0 ... lambda_d. Weights add up to 1: they are shares of
the measure, all positive. Up to degree 6 rules are symmetric in the corners, so that nothing depends on how these are
numbered; beyond there are products of Gauss and Jacobi, on the simplex as a collapsed cube.

Sources: Cowper, 1973 (triangles, degrees 2 and 4); Radon, 1948 (5); Dunavant, 1985 (6); Keast, 1986 (tetrahedra, 2, 5
and 6); Zienkiewicz & Taylor, The Finite Element Method (tetrahedra, 3). All are held to the moments that they claim by
tests; the digits of those of degree 6 were found by Newton's method on these.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations, permutations

from sympy import Expr, Integer, Rational, Symbol, diff, sqrt

#: Of each dimension and degree: shares of the measure, each with a point; its permutations are points, too.
ORBITS: dict[tuple[int, int], tuple[tuple[Expr | float, tuple[Expr | float, ...]], ...]] = {}


def _orbit(d: int, inner: Expr | float, *more: Expr | float) -> tuple[Expr | float, ...]:
    """A point of which the first coordinates are given, one of them as often as it takes."""
    repeated = (inner,) * (d - len(more)) + more
    return (*repeated, 1 - sum(repeated))


_root = sqrt(38 - 44 * sqrt(Rational(2, 5)))
ORBITS[2, 1] = ((Integer(1), _orbit(2, Rational(1, 3))),)
ORBITS[2, 2] = ((Rational(1, 3), _orbit(2, Rational(1, 6))),)
ORBITS[2, 4] = tuple(
    ((620 + s * sqrt(213125 - 53320 * sqrt(10))) / 3720, _orbit(2, (8 - sqrt(10) + s * _root) / 18)) for s in (1, -1)
)
ORBITS[2, 5] = (
    (Rational(9, 40), _orbit(2, Rational(1, 3))),
    *(((155 + s * sqrt(15)) / 1200, _orbit(2, (6 + s * sqrt(15)) / 21)) for s in (1, -1)),
)
ORBITS[2, 6] = (
    (0.11678627572637936603, _orbit(2, 0.24928674517091042129)),
    (0.050844906370206816921, _orbit(2, 0.06308901449150222834)),
    (0.082851075618373575194, _orbit(2, 0.31035245103378440542, 0.053145049844816947353)),
)
ORBITS[3, 1] = ((Integer(1), _orbit(3, Rational(1, 4))),)
ORBITS[3, 2] = ((Rational(1, 4), _orbit(3, (5 - sqrt(5)) / 20)),)
ORBITS[3, 3] = (
    (Rational(1, 40), _orbit(3, Integer(0))),
    (Rational(9, 40), _orbit(3, Rational(1, 3))),
)
ORBITS[3, 5] = (
    (Rational(16, 135), _orbit(3, Rational(1, 4))),
    *(((2665 + s * 14 * sqrt(15)) / 37800, _orbit(3, (7 - s * sqrt(15)) / 34)) for s in (1, -1)),
    (Rational(10, 189), _orbit(3, (5 - sqrt(15)) / 20, (5 + sqrt(15)) / 20)),
)
ORBITS[3, 6] = (
    (0.0399227502581674921, _orbit(3, 0.21460287125915202929)),
    (0.010077211055320642948, _orbit(3, 0.040673958534611353116)),
    (0.055357181543654722095, _orbit(3, 0.32233789014227551034)),
    (Rational(27, 560), _orbit(3, 0.063661001875017525299, 0.26967233145831580803)),
)


@cache
def rule(d: int, degree: int) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Weights and points, in barycentric coordinates, that integrate polynomials of a degree exactly."""
    known = [k for dimension, k in ORBITS if dimension == d and k >= degree]
    return _expanded(ORBITS[d, min(known)]) if known else _product_rule(d, degree // 2 + 1)


def _expanded(
    orbits: tuple[tuple[Expr | float, tuple[Expr | float, ...]], ...],
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """All points of some orbits."""
    weights: list[float] = []
    points: list[tuple[float, ...]] = []
    for weight, point in orbits:
        numbers = [float(Integer(0) + x) for x in point]
        for one in sorted(set(permutations(range(len(numbers)))), key=lambda order: [numbers[i] for i in order]):
            place = tuple(numbers[i] for i in one)
            if not any(max(abs(a - b) for a, b in zip(place, other, strict=True)) < 1e-12 for other in points):
                points.append(place)
                weights.append(float(Integer(0) + weight))
    return tuple(weights), tuple(points)


def _product_rule(d: int, count: int) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Product of rules of Gauss and Jacobi, exact to degree 2 count - 1."""
    from scipy.special import roots_jacobi

    found: list[tuple[float, tuple[float, ...], float]] = [(1.0, (), 1.0)]  # weight, coordinates, what is left of 1
    for axis in range(d):
        power = d - 1 - axis
        nodes, weights = roots_jacobi(count, power, 0)
        parts = [((1 + x) / 2, w * (power + 1) / 2 ** (power + 1)) for x, w in zip(nodes, weights, strict=True)]
        found = [
            (weight * share, (*place, left * part), left * (1 - part))
            for weight, place, left in found
            for part, share in parts
        ]
    return tuple(float(one[0]) for one in found), tuple(tuple(map(float, (*one[1], one[2]))) for one in found)


@cache
def shape_functions(d: int, order: int) -> tuple[tuple[Expr, ...], tuple[Symbol, ...]]:
    """Shape functions of a simplex in its barycentric coordinates, and these.

    Nodes are the corners, and of order 2 then the middles of the edges (0, 1), (0, 2), ... (d - 1, d).
    """
    places = tuple(Symbol(f"lambda{i}", real=True) for i in range(d + 1))
    if order == 1:
        return places, places
    corners = tuple(x * (2 * x - 1) for x in places)
    return (*corners, *(4 * places[i] * places[j] for i, j in combinations(range(d + 1), 2))), places


def node_count(d: int, order: int) -> int:
    """Nodes of an element."""
    return len(shape_functions(d, order)[0])


def values_at(d: int, order: int, points: tuple[tuple[float, ...], ...]) -> tuple[float, ...]:
    """Values of the shape functions at points, those of a point after those of another.

    Parameters
    ----------
    d : int
        Dimensions.
    order : int
        1, linear, or 2.
    points : tuple of tuple of float
        Barycentric coordinates.
    """
    shapes, places = shape_functions(d, order)
    return _numbers(shapes, places, points)


def slopes_at(d: int, order: int, points: tuple[tuple[float, ...], ...]) -> tuple[float, ...]:
    """Their derivatives by each barycentric coordinate, those of a shape function after those of another.

    Parameters
    ----------
    d : int
        Dimensions.
    order : int
        1, linear, or 2.
    points : tuple of tuple of float
        Barycentric coordinates.
    """
    shapes, places = shape_functions(d, order)
    return _numbers(tuple(diff(shape, place) for shape in shapes for place in places), places, points)


def _numbers(
    expressions: tuple[Expr, ...], places: tuple[Symbol, ...], points: tuple[tuple[float, ...], ...]
) -> tuple[float, ...]:
    return tuple(float(expr.subs(dict(zip(places, point, strict=True)))) for point in points for expr in expressions)
