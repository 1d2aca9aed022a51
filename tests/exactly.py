"""The quantities of a law in numbers of any precision, from its four expressions and eqs. 1, 2 alone.

Nothing here is shared with the derivation: stiffness and friction come from the geometry X = 2R + h - 2 delta and the
force balance F = F_ela(a(h, delta), delta), differentiated as they stand.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import mpmath
from sympy import Symbol, lambdify

from softdyn.derive import ContactLaw, E, R, a, delta, eta, h

UNITS = {R: 1, E: 1, eta: 1}


@lru_cache(maxsize=64)
def _functions(law: ContactLaw) -> tuple[tuple[Symbol, ...], dict[str, Any]]:
    own = tuple(sorted(law.parameters, key=str))
    force = law.F_ela.subs(a, law.a)
    expressions = {
        "a": law.a,
        "zeta": law.zeta.subs(a, law.a),
        "F": force,
        "F_adh": law.F_adh.subs(a, law.a),
        "F_h": force.diff(h),
        "F_delta": force.diff(delta),
    }
    arguments = (h, delta, *own)
    return own, {name: lambdify(arguments, expr.subs(UNITS), "mpmath") for name, expr in expressions.items()}


def quantities(law: ContactLaw, gap: Any, deflection: Any, own: Mapping[Symbol, Any] | None = None) -> dict[str, Any]:
    """Every quantity that a limit can claim, at R = E = eta = 1."""
    symbols, functions = _functions(law)
    at = (gap, deflection, *((own or {})[symbol] for symbol in symbols))
    found = {name: function(*at) for name, function in functions.items()}
    net = found["F"] - found["F_adh"]
    found["delta"] = deflection
    found["dh_dt"] = -net / found["zeta"]
    # dF = F_h dh + F_delta d(delta) = 0 at constant force; dX = dh - 2 d(delta)
    found["dX_dt"] = found["dh_dt"] * (1 + 2 * found["F_h"] / found["F_delta"])
    found["C"] = found["F_delta"] / 2
    found["D"] = found["zeta"] / (1 + 2 * found["F_h"] / found["F_delta"])
    return found


def deflection(law: ContactLaw, gap: Any, force: Any, own: Mapping[Symbol, Any] | None = None) -> Any:
    """Deflection at given gap and force, by bisection in its logarithm and a few secant steps."""
    symbols, functions = _functions(law)
    values = tuple((own or {})[symbol] for symbol in symbols)
    side = 1 if force > 0 else -1

    def excess(exponent: Any) -> Any:
        size = mpmath.exp(exponent)
        return mpmath.log(side * functions["F"](gap, side * size, *values) / abs(force))

    low, high = mpmath.mpf(-2000), mpmath.mpf(2000)
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    root = mpmath.findroot(excess, (low, high), solver="anderson", tol=mpmath.mpf(10) ** (-2 * mpmath.mp.dps + 10))
    return side * mpmath.exp(root)


def gap_energy_slope(law: ContactLaw, gap: Any, deflection: Any, own: Mapping[Symbol, Any] | None = None) -> Any:
    """U_h = integral from 0 to delta of 2 dF/dh, by quadrature over each decade."""
    symbols, functions = _functions(law)
    values = tuple((own or {})[symbol] for symbol in symbols)
    side = 1 if deflection > 0 else -1
    ends = [mpmath.log(abs(deflection)) - k * mpmath.log(10) for k in range(30, -1, -1)]

    def integrand(exponent: Any) -> Any:
        size = mpmath.exp(exponent)
        return 2 * side * size * functions["F_h"](gap, side * size, *values)

    return mpmath.quad(integrand, ends)
