"""Coefficients of Radau IIA, a collocation method: on each step a polynomial obeys the equation at the nodes.

Hairer & Wanner, Solving Ordinary Differential Equations II, section IV.5. With 8 nodes the polynomial is accurate to
order 9 throughout the step, so that it is the dense output as well, and to order 15 at its end; the method is L-stable,
and its stages, unlike those of an explicit method, are evaluated side by side. All coefficients follow from the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mpmath
from numpy.polynomial.legendre import legroots

#: Nodes of a step in time: as many as the widest vector registers hold doubles.
STAGES = 8
#: Nodes of a panel of the gap, where the time is an integral: the more, the wider panels can be, at no iterations.
PANEL_NODES = 16
_DIGITS = 40


@dataclass(frozen=True)
class Collocation:
    """A collocation method on the nodes 0 < c_1 < ... < c_s = 1, in double precision.

    Attributes
    ----------
    nodes : tuple of float
        0 and the s nodes, at which a step's polynomial is known.
    weights : tuple of float
        Barycentric weights of these s + 1 points.
    inverse : tuple of float
        The inverse of the Runge-Kutta matrix, by columns: (A^-1)[i][j] at s*j + i.
    matrix : tuple of float
        The Runge-Kutta matrix A, by columns.
    quadrature : tuple of float
        The last row of A: weights of the nodes in an integral over the step.
    chebyshev : tuple of float
        Weights of the values at the s nodes, with 0 at 0, in the polynomial's coefficients by Chebyshev's polynomials
        T_k(2 theta - 1): by columns: that of value j in T_k at (s + 1)*j + k.
    slope_start : tuple of float
        Weights of the s + 1 values in the derivative of the polynomial at 0.
    probe : float
        A point between two nodes, at which the defect is measured besides 0.
    value_probe, slope_probe : tuple of float
        Weights of the s + 1 values in the polynomial and in its derivative there.
    error_start, error_probe : float
        The largest error within a step, for a step that is not stiff, over the defect at 0 and at the probe. In a
        stiff step the error is that defect over J: smaller by 1 + error_start abs(step J), since M is largest at 0.
    """

    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    inverse: tuple[float, ...]
    matrix: tuple[float, ...]
    quadrature: tuple[float, ...]
    chebyshev: tuple[float, ...]
    slope_start: tuple[float, ...]
    probe: float
    value_probe: tuple[float, ...]
    slope_probe: tuple[float, ...]
    error_start: float
    error_probe: float


@cache
def radau_iia(stages: int = STAGES) -> Collocation:
    """Radau IIA from its definition: the nodes are the zeros of P_s - P_(s-1), with P_n Legendre's on (0, 1)."""
    with mpmath.workdps(_DIGITS):
        nodes = _nodes(stages)
        points = [mpmath.mpf(0), *nodes]
        powers = mpmath.matrix([[c**j for j in range(stages)] for c in nodes])
        integrals = mpmath.matrix([[c ** (j + 1) / (j + 1) for j in range(stages)] for c in nodes])
        inverse = powers * integrals**-1
        matrix = inverse**-1
        chebyshev = mpmath.matrix([[mpmath.chebyt(j, 2 * x - 1) for j in range(stages + 1)] for x in points]) ** -1
        # the defect is K M, with M the product of (theta - c_i), and the error that it makes K times its integral
        node_polynomial = [mpmath.mpf(1)]
        for c in nodes:
            node_polynomial = _times(node_polynomial, [-c, mpmath.mpf(1)])
        integral = [mpmath.mpf(0), *(x / (n + 1) for n, x in enumerate(node_polynomial))]
        # the integral is largest where M vanishes, and M at 0
        largest_integral = max(abs(_at(integral, c)) for c in nodes)
        middle = stages // 2
        probe = (nodes[middle - 1] + nodes[middle]) / 2
        return Collocation(
            nodes=_floats(points),
            weights=_floats([1 / mpmath.fprod(x - y for y in points if y != x) for x in points]),
            inverse=_floats([inverse[i, j] for j in range(stages) for i in range(stages)]),
            matrix=_floats([matrix[i, j] for j in range(stages) for i in range(stages)]),
            quadrature=_floats([matrix[stages - 1, j] for j in range(stages)]),
            chebyshev=_floats([chebyshev[k, j + 1] for j in range(stages) for k in range(stages + 1)]),
            slope_start=_floats(_weights(points, mpmath.mpf(0), derivative=True)),
            probe=float(probe),
            value_probe=_floats(_weights(points, probe, derivative=False)),
            slope_probe=_floats(_weights(points, probe, derivative=True)),
            error_start=float(largest_integral / abs(_at(node_polynomial, mpmath.mpf(0)))),
            error_probe=float(largest_integral / abs(_at(node_polynomial, probe))),
        )


@dataclass(frozen=True)
class Blindness:
    """What a step's stages do not see of a rate that depends on time alone, as a part of the step's length.

    The step follows the rate's polynomial through its stages. With x from -1 to 1 over the step, a term x^k of the rate
    adds to the solution what differs from that by ``within`` ``within_growth``^(k - s) at most anywhere within the
    step, and by ``end`` ``end_growth``^(k - 2 s + 1) at its end, for every k from s, and from 2 s - 1, on; below there
    is no difference. Any rate bounded by 1 adds what differs by ``any`` at most.
    """

    within: float
    within_growth: float
    end: float
    end_growth: float
    any: float


@cache
def blindness(stages: int = STAGES) -> Blindness:
    """Of Radau IIA: the integrals of the terms less those of their polynomials, the largest of 100 points."""
    with mpmath.workdps(_DIGITS):
        points = [2 * c - 1 for c in _nodes(stages)]
        cardinals = [_integral(_cardinal(points, point)) for point in points]
        at = [mpmath.mpf(k) / 50 - 1 for k in range(101)]
        start = [_at(one, mpmath.mpf(-1)) for one in cardinals]
        part = [[_at(one, x) - first for one, first in zip(cardinals, start, strict=True)] for x in at]
        powers = [[point**k for point in points] for k in range(4 * stages)]

        def off(k: int, i: int) -> mpmath.mpf:
            exact = (at[i] ** (k + 1) - (-1) ** (k + 1)) / (k + 1)
            return abs(exact - mpmath.fdot(part[i], powers[k])) / 2

        within = [max(off(k, i) for i in range(len(at))) for k in range(stages, 3 * stages)]
        end = [off(k, len(at) - 1) for k in range(2 * stages - 1, 4 * stages)]
        largest = max(mpmath.fsum(abs(w) for w in row) + x + 1 for row, x in zip(part, at, strict=True)) / 2
        growths = (
            max((x / of[0]) ** (mpmath.mpf(1) / n) for n, x in enumerate(of[1:], start=1)) for of in (within, end)
        )
        return Blindness(*_floats([within[0], next(growths), end[0], next(growths), largest]))


def _cardinal(points: list[mpmath.mpf], point: mpmath.mpf) -> list[mpmath.mpf]:
    """Coefficients of the polynomial that is 1 at one of the points and 0 at the others."""
    found = [mpmath.mpf(1)]
    for other in points:
        if other != point:
            found = _times(found, [-other / (point - other), 1 / (point - other)])
    return found


def _integral(polynomial: list[mpmath.mpf]) -> list[mpmath.mpf]:
    return [mpmath.mpf(0), *(c / (n + 1) for n, c in enumerate(polynomial))]


@cache
def _nodes(stages: int) -> list[mpmath.mpf]:
    """By Newton's iteration from the roots in doubles: each step doubles their digits."""
    with mpmath.workdps(2 * _DIGITS):
        high, low = _legendre(stages), [*_legendre(stages - 1), mpmath.mpf(0)]
        difference = [x - y for x, y in zip(high, low, strict=True)]
        slopes = [n * x for n, x in enumerate(difference)][1:]
        roots = [mpmath.mpf(float(root)) for root in legroots([*[0] * (stages - 1), -1, 1]).real]
        for _ in range(3):  # 12 digits become 96
            roots = [root - _at(difference, root) / _at(slopes, root) for root in roots]
        nodes = sorted((1 + root) / 2 for root in roots)
        return [*nodes[:-1], mpmath.mpf(1)]


def _legendre(degree: int) -> list[mpmath.mpf]:
    """Coefficients of a Legendre polynomial on (-1, 1), by rising powers."""
    before, now = [mpmath.mpf(1)], [mpmath.mpf(0), mpmath.mpf(1)]
    if degree == 0:
        return before
    for n in range(1, degree):
        shifted = [mpmath.mpf(0), *now]
        padded = [*before, mpmath.mpf(0), mpmath.mpf(0)]
        before, now = now, [((2 * n + 1) * x - n * y) / (n + 1) for x, y in zip(shifted, padded, strict=True)]
    return now


def _times(left: list[mpmath.mpf], right: list[mpmath.mpf]) -> list[mpmath.mpf]:
    product = [mpmath.mpf(0)] * (len(left) + len(right) - 1)
    for i, x in enumerate(left):
        for j, y in enumerate(right):
            product[i + j] += x * y
    return product


def _at(polynomial: list[mpmath.mpf], x: mpmath.mpf) -> mpmath.mpf:
    return mpmath.polyval(polynomial[::-1], x)


def _weights(points: list[mpmath.mpf], x: mpmath.mpf, *, derivative: bool) -> list[mpmath.mpf]:
    """Weights of the values at the points in the value, or the derivative, of their polynomial at x."""
    result = []
    for point in points:
        others = [other for other in points if other != point]
        cardinal = [1 / mpmath.fprod(point - other for other in others)]
        for other in others:
            cardinal = _times(cardinal, [-other, mpmath.mpf(1)])
        slopes = [n * coefficient for n, coefficient in enumerate(cardinal)][1:]
        result.append(_at(slopes if derivative else cardinal, x))
    return result


def _floats(values: list[mpmath.mpf]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
