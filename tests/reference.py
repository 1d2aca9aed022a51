"""The outputs of a kernel computed another way: the law as it is declared, differentiated by sympy, 50 digits.

Nothing of softdyn's derivation is used, neither its equations nor its rewriting: only the four declared expressions,
their plain derivatives, and eqs. 1, 2, 7 and 9 written out below. Each output comes with its *size*: the same formula
with every term of its sums replaced by its magnitude. Floating point can be expected to be accurate to a few units in
the last place of the size; where nothing cancels, size and magnitude are one.
"""

from __future__ import annotations

import decimal
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Integer, Rational, Symbol, cse, diff, lambdify
from sympy.printing.pycode import PythonCodePrinter

from softdyn.derive import ContactLaw, a, delta, h
from softdyn.derive.law import parameters_of

Array = NDArray[np.float64]
DIGITS = 50
#: Stands for delta -> 0 in lambda1, whose formula is 0/0 there; it changes the result by less than 1e-60.
ALMOST_NOTHING = 1e-80


def ingredients(law: ContactLaw) -> dict[str, Expr]:
    """Return the declared expressions and their first partial derivatives; all but those of a are in (a, h, delta)."""
    return {
        "a": law.a,
        "a_h": diff(law.a, h),
        "a_delta": diff(law.a, delta),
        "F_ela": law.F_ela,
        "F_a": diff(law.F_ela, a),
        "F_delta": diff(law.F_ela, delta),
        "zeta": law.zeta,
        "zeta_a": diff(law.zeta, a),
        "zeta_h": diff(law.zeta, h),
        "F_adh": law.F_adh,
        "F_adh_a": diff(law.F_adh, a),
        "F_adh_h": diff(law.F_adh, h),
    }


def contact(values: Mapping[str, Any], R: Any, h: Any, delta: Any, F: Any, dF_dt: Any) -> dict[str, tuple[Any, Any]]:
    """Each output and its size, from the ingredients, in whatever arithmetic these are."""
    v = values
    C_terms = (v["F_a"] * v["a_delta"] / 2, v["F_delta"] / 2)
    C = sum(C_terms)
    coupling = v["F_a"] * v["a_h"]
    drive, drive_size = F - v["F_adh"], abs(F) + abs(v["F_adh"])
    # the elastic response to a change of the gap, C + F_a a_h, may cancel
    response = C + coupling
    amplified = (abs(C) + abs(coupling)) / abs(response)
    D = C * v["zeta"] / response
    dh_dt, dh_size = -drive / v["zeta"], drive_size / v["zeta"]
    slope = -coupling / (2 * C)
    rate_terms = (v["zeta_a"] * v["a_h"], v["zeta_h"], slope * v["zeta_a"] * v["a_delta"])
    remote_terms = (v["F_adh_a"] * v["a_h"], v["F_adh_h"], slope * v["F_adh_a"] * v["a_delta"])
    lambda2, lambda2_size = -h * sum(rate_terms) / v["zeta"], h * sum(map(abs, rate_terms)) / v["zeta"]
    if drive != 0:
        lambda2 -= h * sum(remote_terms) / drive
        lambda2_size += h * sum(map(abs, remote_terms)) / abs(drive) * (drive_size / abs(drive))
    plain = {name: (v[name], abs(v[name])) for name in ("a", "F_ela", "zeta", "F_adh")}
    return {
        **plain,
        "C": (C, sum(map(abs, C_terms))),
        "D": (D, abs(D) * amplified),
        "dh_dt": (dh_dt, dh_size),
        "ddelta_dt": ((dF_dt - coupling * dh_dt) / (2 * C), (abs(dF_dt) + abs(coupling) * dh_size) / abs(2 * C)),
        "dX_dt": (-dF_dt / C - drive / D, abs(dF_dt / C) + drive_size / abs(D) * amplified),
        "X": (2 * R + h - 2 * delta, 2 * R + h + 2 * abs(delta)),
        "lambda1": (h / delta * slope if delta else None, abs(h / delta * slope) if delta else None),
        "lambda2": (lambda2, lambda2_size),
    }


Evaluate = Callable[..., dict[str, tuple[Any, Any]]]


def exact(law: ContactLaw) -> Evaluate:
    """Return a law's outputs in mpmath, as a function of (parameters, h, delta, F, dF_dt), all of them mpf."""
    names = parameters_of(law)
    expressions = ingredients(law)
    radius = lambdify([h, delta, *names], [expressions[name] for name in ("a", "a_h", "a_delta")], "mpmath")
    others = [name for name in expressions if not name.startswith("a")]
    rest = lambdify([a, h, delta, *names], [expressions[name] for name in others], "mpmath")
    return _evaluator(radius, others, rest, mpmath.mpf, names.index(_radius(names)))


def _radius(names: Sequence[Symbol]) -> Symbol:
    return next(symbol for symbol in names if symbol.name == "R")


def _evaluator(
    radius: Callable[..., Any], others: Sequence[str], rest: Callable[..., Any], number: Callable[..., Any], index: int
) -> Evaluate:
    def values(p: Sequence[Any], h: Any, delta: Any) -> dict[str, Any]:
        a_value, a_h, a_delta = radius(h, delta, *p)
        found = rest(a_value, h, delta, *p)
        return {"a": a_value, "a_h": a_h, "a_delta": a_delta, **dict(zip(others, found, strict=True))}

    def evaluate(p: Sequence[Any], h: Any, delta: Any, F: Any, dF_dt: Any) -> dict[str, tuple[Any, Any]]:
        outputs = contact(values(p, h, delta), p[index], h, delta, F, dF_dt)
        if delta == 0:
            tiny = number(ALMOST_NOTHING)
            outputs["lambda1"] = contact(values(p, h, tiny), p[index], h, tiny, F, dF_dt)["lambda1"]
        return outputs

    return evaluate


class _DecimalPrinter(PythonCodePrinter):
    """Arithmetic, square roots, abs and sign for decimal.Decimal; anything else is an error."""

    def _print_Rational(self, expr: Rational) -> str:
        return f"(D({expr.p})/D({expr.q}))"

    def _print_Integer(self, expr: Integer) -> str:
        return f"D({expr.p})"

    def _print_Pi(self, expr: Expr) -> str:
        return "PI"

    def _print_Pow(self, expr: Expr, rational: bool = False) -> str:
        power = 2 * expr.exp
        if not power.is_Integer:
            raise NotImplementedError(f"{expr} in decimal arithmetic")
        base = f"({self._print(expr.base)})"
        return f"{base}**{expr.exp}" if expr.exp.is_Integer else f"{base}.sqrt()**{power}"

    def _print_Abs(self, expr: Expr) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_sign(self, expr: Expr) -> str:
        return f"sign({self._print(expr.args[0])})"


PI = decimal.Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803")


def exact_decimal(law: ContactLaw) -> Evaluate:
    """Like :func:`exact`, in the arithmetic of the decimal module: fifty times as fast, for algebraic laws only."""
    names = parameters_of(law)
    expressions = ingredients(law)
    scope: dict[str, Any] = {"D": decimal.Decimal, "PI": PI, "sign": lambda x: (x > 0) - (x < 0)}

    def compiled(arguments: Sequence[Symbol], wanted: Sequence[str]) -> Callable[..., Any]:
        text = _DecimalPrinter({"fully_qualified_modules": False}).doprint
        shared, reduced = cse([expressions[name] for name in wanted])
        lines = [f"def function({', '.join(map(text, arguments))}):"]
        lines += [f"    {name} = {text(expr)}" for name, expr in shared]
        lines += [f"    return {', '.join(map(text, reduced))}"]
        made: dict[str, Any] = {}
        exec("\n".join(lines), scope, made)
        return made["function"]

    others = [name for name in expressions if not name.startswith("a")]
    radius = compiled([h, delta, *names], ["a", "a_h", "a_delta"])
    return _evaluator(
        radius, others, compiled([a, h, delta, *names], others), decimal.Decimal, names.index(_radius(names))
    )


class Exact:
    """Numbers known to more than double precision: a double and what it lacks."""

    def __init__(self, values: Sequence[Any]) -> None:
        number = type(values[0])
        self.high = np.array([float(value) for value in values])
        self.low = np.array(
            [float(value - number(high)) for value, high in zip(values, self.high.tolist(), strict=True)]
        )

    def error(self, computed: Array) -> Array:
        """Magnitude of computed - exact, itself exact to double precision where the two are close."""
        return np.abs((computed - self.high) - self.low)


def ulp(x: Array) -> Array:
    """One unit in the last place of |x|."""
    return np.spacing(np.abs(x))
