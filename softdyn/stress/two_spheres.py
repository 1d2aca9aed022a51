"""Exact friction of two rigid spheres of any radii, and of a sphere and a wall, along the line of their centres.

Stokes flow in bispherical coordinates: G. B. Jeffery and M. Stimson, Proc. R. Soc. Lond. A 111 (1926) 110; A. D. Maude,
Br. J. Appl. Phys. 12 (1961) 293; H. Brenner, Chem. Eng. Sci. 16 (1961) 242. All in mpmath.

The stream function is (cosh xi - mu)^(-3/2) sum over n of U_n(xi) (P_(n-1) - P_(n+1))(mu), with four constants in each
U_n. On a sphere that moves at V along the axis, U_n = V f_n and U_n' = V f_n', the same expansion of -rho^2/2.
"""

from __future__ import annotations

from typing import Any

import mpmath

Number = Any


def _given(n: int, xi: Number) -> tuple[Number, Number]:
    """f_n and its slope at xi, with the length c = 1; even in xi. A wall, xi = 0, is at rest."""
    if xi == 0:
        return mpmath.mpf(0), mpmath.mpf(0)
    low, high = n - mpmath.mpf(1) / 2, n + mpmath.mpf(3) / 2
    size, side = abs(xi), mpmath.sign(xi)
    scale = -mpmath.mpf(n * (n + 1)) / (2 * n + 1) / mpmath.sqrt(2)
    value = mpmath.exp(-low * size) / (2 * low) - mpmath.exp(-high * size) / (2 * high)
    slope = (mpmath.exp(-high * size) - mpmath.exp(-low * size)) / 2
    return scale * value, side * scale * slope


def _alone(n: int, xi: Number) -> Number:
    """Term n of the force on a sphere that is alone: U_n falls from its surface on. The terms add up to 1/sinh(xi)."""
    low, high = n - mpmath.mpf(1) / 2, n + mpmath.mpf(3) / 2
    f, slope = _given(n, xi)
    return ((high * f - slope) * mpmath.exp(-low * xi) - (low * f - slope) * mpmath.exp(-high * xi)) / 2


def resistance(alpha: Number, beta: Number) -> tuple[Number, ...]:
    """Forces (on 1 by motion of 1, on 1 by 2, on 2 by 2) over 6 pi eta c; surfaces at xi = alpha and -beta (0: a wall).

    The fluid holds back what moves: the first and the last are positive. Of these only what differs from the force on
    a sphere alone is summed: it falls as exp(-n (alpha + beta)), however small one of the two is.
    """
    found = [1 / mpmath.sinh(alpha), mpmath.mpf(0), 1 / mpmath.sinh(beta) if beta else mpmath.mpf(0)]
    n = 1
    while True:
        powers = (n - mpmath.mpf(1) / 2, n + mpmath.mpf(3) / 2)
        falls = [mpmath.exp(-k * (alpha + beta)) for k in powers]
        # U_n = sum of p_k exp(k (xi - alpha)) + q_k exp(-k (xi + beta))
        rows = mpmath.matrix(
            [
                [1, 1, *falls],
                [*powers, *(-k * fall for k, fall in zip(powers, falls, strict=True))],
                [*falls, 1, 1],
                [*(k * fall for k, fall in zip(powers, falls, strict=True)), *(-k for k in powers)],
            ]
        )
        by_1 = mpmath.lu_solve(rows, mpmath.matrix([*_given(n, alpha), 0, 0]))
        by_2 = mpmath.lu_solve(rows, mpmath.matrix([0, 0, *_given(n, -beta)]))
        out_1, out_2 = ([mpmath.exp(-k * xi) for k in powers] for xi in (alpha, beta))
        weight = -mpmath.sqrt(8) / 3 * (2 * n + 1)
        terms = [
            weight * (by_1[0] * out_1[0] + by_1[1] * out_1[1] - _alone(n, alpha)),
            weight * (by_2[0] * out_1[0] + by_2[1] * out_1[1]),
            weight * (by_2[2] * out_2[0] + by_2[3] * out_2[1] - _alone(n, beta)) if beta else mpmath.mpf(0),
        ]
        found = [one + term for one, term in zip(found, terms, strict=True)]
        if n * (alpha + beta) > 1 and max(map(abs, terms)) < mpmath.mpf(10) ** -14 * found[0]:
            return tuple(found)
        n += 1


def friction(gap: float, ratio: float) -> float:
    """Force over the speed at which spheres of radii 1 and ``ratio`` approach under equal and opposite forces.

    Over 6 pi eta R1 R2/(R1 + R2), which it is far apart. ``inf``: a wall at rest, over 6 pi eta.
    """
    with mpmath.workdps(60):
        h, R2 = mpmath.mpf(gap), mpmath.mpf(ratio)
        if mpmath.isinf(R2):
            alpha = mpmath.acosh(1 + h)
            return float(resistance(alpha, mpmath.mpf(0))[0] * mpmath.sinh(alpha))
        d = 1 + R2 + h
        alpha, beta = mpmath.acosh((d**2 + 1 - R2**2) / (2 * d)), mpmath.acosh((d**2 + R2**2 - 1) / (2 * d * R2))
        K11, K12, K22 = resistance(alpha, beta)
        c = mpmath.sinh(alpha)
        # forces (1, -1): difference of the velocities
        speed = (K11 + K22 + 2 * K12) / (K11 * K22 - K12**2)
        return float(c / speed * (1 + R2) / R2)
