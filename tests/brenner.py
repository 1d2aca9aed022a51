"""Brenner's exact series for the friction of two equal spheres that approach, and half-spaces under a pressure.

H. Brenner, Chem. Eng. Sci. 16 (1961) 242; K. L. Johnson, Contact Mechanics, 1985, ch. 3. All in mpmath.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath


def friction(gap: mpmath.mpf) -> mpmath.mpf:
    """Friction of two equal rigid spheres over 3 pi eta R, at h/R = gap; in 40 digits, since the series cancels."""
    with mpmath.workdps(40):
        alpha = mpmath.acosh(1 + mpmath.mpf(gap) / 2)
        total, n, sinh = mpmath.mpf(0), 1, mpmath.sinh(alpha)
        while True:
            odd = 2 * n + 1
            top = 4 * mpmath.cosh(odd * alpha / 2) ** 2 + odd**2 * sinh**2
            bottom = 2 * mpmath.sinh(odd * alpha) - odd * mpmath.sinh(2 * alpha)
            term = mpmath.mpf(n * (n + 1)) / ((odd - 2) * (odd + 2)) * (top / bottom - 1)
            total += term
            # terms fall as exp(-2 n alpha), once n alpha > 1
            if n * alpha > 1 and abs(term) < mpmath.mpf(10) ** -16 * abs(total) * alpha:
                return 4 * sinh * total / 3
            n += 1


def deflection(pressure: Callable[[mpmath.mpf], mpmath.mpf], r: mpmath.mpf, radius: mpmath.mpf) -> mpmath.mpf:
    """Deflection at r of a half-space of E/(1 - nu^2) = 1 under an axisymmetric pressure over r < radius, or all."""
    with mpmath.workdps(30):
        if r == 0:
            return 2 * mpmath.quad(pressure, [0, 1, 10, mpmath.inf] if radius == mpmath.inf else [0, radius])

        def ring(s: mpmath.mpf) -> mpmath.mpf:
            modulus = 4 * r * s / (r + s) ** 2
            # the kernel is singular, as a logarithm, at s = r: rounded, nodes may come to lie on it
            return pressure(s) * s / (r + s) * mpmath.ellipk(modulus) if modulus < 1 else mpmath.mpf(0)

        ends = [0, r, *([radius] if radius <= 10 * r else [10 * r, radius])]
        return 4 / mpmath.pi * mpmath.quad(ring, ends)
