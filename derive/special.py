"""Lambert's W, which math.h does not have, for kernels.

W(x) exp(W(x)) = x, on its principal branch: x >= -1/e, W >= -1; no number below. Three parts:

- Beside the branch point, x < -1/4: with p = sqrt(2 (e x + 1)), W = p Q(p) - 1, Q analytic; e is a sum of three
  numbers and x of two, so that what is left of e x + 1 has all its digits. Q interpolates at Chebyshev's points.
- Up to 1: Halley's method for W = x exp(-W), whose right side has no rounding of a difference.
- Beyond: Newton's method for W = ln(x/W), as Fritsch, Shafer & Crowley, Commun. ACM 16 (1973) 123, have it.

Both methods start from Winitzki's formula, within 2 %, and their third step changes nothing. Errors stay below 4 units
in the last place.
"""

from __future__ import annotations

import math
import re
from functools import cache
from typing import Any

import mpmath
import numpy as np
from sympy import Expr, exp
from sympy import LambertW as GeneralLambertW

from softdyn.derive import bessel

#: Names of functions in kernels, by those that sympy has for them.
NAMES = {"LambertW": "_lambert_w"} | bessel.NAMES
#: Coefficients of Q, enough to leave less than 2^-60.
COEFFICIENTS = 21
#: Digits that they are computed with.
DIGITS = 50
#: The smallest number of which W has a value: -1/e, rounded towards 0.
LOWEST = -0.3678794411714423


class LambertW(GeneralLambertW):
    """The principal branch, with derivatives that have a value at 0: sympy's hold W(x)/x."""

    def fdiff(self, argindex: int = 1) -> Expr:
        """Return 1/(exp(W) (1 + W))."""
        return exp(-self) / (1 + self)


def in_numbers(x: Any) -> Any:
    """W of numbers or arrays, where no kernel is at hand; nan below -1/e."""
    from scipy.special import lambertw

    return np.where(np.asarray(x) >= LOWEST, lambertw(x).real, math.nan)[()]


#: For sympy's lambdify, before the modules "math" and "numpy", which have no such function.
IN_NUMPY = {"LambertW": in_numbers}


def principal(x: Expr, branch: Expr | int = 0) -> Expr:
    """Lambert's W as laws have it; another branch as it is."""
    return LambertW(x) if branch == 0 else GeneralLambertW(x, branch)


def branch_series(p: Any) -> Any:
    """Q(p) = (W((p^2/2 - 1)/e) + 1)/p."""
    return (mpmath.re(mpmath.lambertw((p**2 / 2 - 1) / mpmath.e)) + 1) / p


@cache
def constants() -> dict[str, float | tuple[float, ...]]:
    """Numbers that the functions take, each rounded once.

    Returns
    -------
    dict
        ``low``, the least argument; ``e1`` and ``e2``, of 26 bits, and ``e3``, which together are e; ``branch``:
        coefficients of Q in 2 p - 1, that of power 0 first.
    """
    with mpmath.workdps(DIGITS):
        e1 = mpmath.floor(mpmath.ldexp(mpmath.e, 24)) / 2**24
        e2 = mpmath.floor(mpmath.ldexp(mpmath.e - e1, 50)) / mpmath.mpf(2) ** 50
        found = mpmath.chebyfit(lambda u: branch_series((1 + u) / 2), [-1, 1], COEFFICIENTS)
        branch = tuple(float(value) for value in reversed(found))
        return {"low": LOWEST, "e1": float(e1), "e2": float(e2), "e3": float(mpmath.e - e1 - e2), "branch": branch}


def calls_lambert(body: str) -> bool:
    """Whether a kernel's body calls Lambert's W."""
    return re.search(r"\b_lambert_w\(", body) is not None
