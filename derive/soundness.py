"""Numerically sound forms of an expression.

Of several equal forms, the one that cannot lose digits is kept: a sum whose terms may have opposite signs can cancel,
one whose terms have the same sign cannot. Signs follow from the assumptions on the symbols (R, E, eta, h, a > 0; delta
real), so the choice is exact, and the same on every machine.
"""

from __future__ import annotations

from functools import lru_cache

from sympy import (
    Abs,
    Add,
    DiracDelta,
    Dummy,
    Expr,
    Function,
    Heaviside,
    Mul,
    Piecewise,
    Pow,
    S,
    Symbol,
    Wild,
    cosh,
    exp,
    factor,
    factor_terms,
    log,
    sign,
    tanh,
    together,
)
from sympy.codegen.cfunctions import expm1, log1p
from sympy.core.relational import Relational

from softdyn.derive.symbols import delta

_any = Wild("any")

#: Sizes of delta where surfaces are pressed together, and where they are pulled apart.
PRESSED, PULLED = Dummy("delta", nonnegative=True), Dummy("delta", positive=True)

#: Rewriting a larger expression takes long, and its expanded form is unreadable.
MOST_OPERATIONS = 120
#: So does factoring a polynomial in more roots and functions than this, or of a higher degree.
MOST_GENERATORS = 3
HIGHEST_POWER = 24


# kernels of one law, whatever they leave out, ask for the same forms
@lru_cache(maxsize=4096)
def sound(*candidates: Expr) -> Expr:
    """Return the form of the candidates (equal expressions) with the fewest sums that may cancel.

    Ties go to the fewest operations, then to the first. ``exp(x) - 1`` and ``log(1 + x)`` become ``expm1`` and
    ``log1p``, ``1 - tanh(x)**2`` becomes ``1/cosh(x)**2``.

    Examples
    --------
    >>> from softdyn.derive import R, h
    >>> sound((R*h/(R + h)).diff(h))   # not R/(R + h) - R*h/(R + h)**2, which cancels at h >> R
    R**2/(R + h)**2
    """
    sides = sides_of(*candidates)
    if sides is not None:
        return joined(*(sound(*expressions) for expressions in sides))
    forms: list[Expr] = []
    for candidate in candidates:
        plain = tidy(candidate)
        forms.append(plain)
        if plain.has(Add):
            rewrites = [factor_terms, *([together, factor, _factor_terms_of_fraction] if rewritable(plain) else [])]
            forms += [tidy(rewrite(plain)) for rewrite in rewrites]
    # exp(x - y) split into exp(x) exp(-y) overflows where the whole does not
    whole = min(len(form.atoms(exp)) for form in forms)
    forms = [form for form in forms if len(form.atoms(exp)) == whole]
    best = min(forms, key=lambda form: (cancelling_sums(form), form.count_ops(), forms.index(form)))
    return best.replace(lambda node: isinstance(node, Add) and node.has(exp), _merge_exp_minus_one)


@lru_cache(maxsize=512)
def relative_slope(product: Expr, variable: Symbol) -> Expr:
    """Return the slope of a product relative to it, factor by factor: no power of a large factor stands in it."""
    sides = sides_of(product)
    if sides is not None:
        return joined(*(relative_slope(expr, variable) for (expr,) in sides))
    factors = [factor_.as_base_exp() for factor_ in Mul.make_args(product)]
    return Add(*(power * sound(base.diff(variable) / base) for base, power in factors if base.has(variable)))


def sides_of(*expressions: Expr) -> tuple[list[Expr], list[Expr]] | None:
    """Return what expressions are where delta >= 0 and where delta < 0, if any has a branch for each; else None.

    The delta of each is a symbol that knows its sign, so that sums of it are seen not to cancel.
    """
    if not any(is_side(condition) for expr in expressions for condition in expr.atoms(Relational)):
        return None
    return tuple([at_side(expr, symbol) for expr in expressions] for symbol in (PRESSED, -PULLED))  # type: ignore[return-value]


def is_side(condition: Relational) -> bool:
    """Whether a condition asks for the sign of delta alone."""
    return condition.free_symbols == {delta} and bool(condition.subs(delta, 1) != condition.subs(delta, -1))


def at_side(expr: Expr, deflection: Expr) -> Expr:
    """Return an expression at a deflection of known sign, without the branches of the other."""
    return expr.xreplace({delta: deflection}).replace(
        lambda node: isinstance(node, Piecewise), lambda node: node.func(*node.args)
    )


def of_pressed(expr: Expr) -> Expr:
    """Return an expression without its branches where delta < 0."""
    return at_side(expr, PRESSED).xreplace({PRESSED: delta}) if sides_of(expr) is not None else expr


def joined(pressed: Expr, pulled: Expr) -> Expr:
    """Return one expression of two that hold where delta >= 0 and where delta < 0, as :func:`sides_of` has them.

    What both have in common stands outside of the branches.
    """
    return _joined(pressed.xreplace({PRESSED: delta}), pulled.xreplace({PULLED: -delta}))


def _joined(above: Expr, below: Expr) -> Expr:
    if above == below:
        return above
    if above.is_Pow and below.is_Pow and above.exp == below.exp:
        return _joined(above.base, below.base) ** above.exp
    factors, others = Mul.make_args(above), Mul.make_args(below)
    common = [factor_ for factor_ in factors if factor_ in others]
    if not common:
        return Piecewise((above, delta >= 0), (below, True))
    rest = [Mul(*(x for x in some if x not in common)) for some in (factors, others)]
    return Mul(*common) * _joined(*rest)


def rewritable(expr: Expr) -> bool:
    """Whether an expression is small enough for sympy's polynomials: they factor it, and give up on no large one."""
    roots = {node.base for node in expr.atoms(Pow) if not node.exp.is_Integer}
    functions = {node for node in expr.atoms(Function) if not isinstance(node, (Abs, sign))}
    powers = [node.exp for node in expr.atoms(Pow)]
    powers += [term.as_coeff_Mul()[0] for node in expr.atoms(exp) for term in Add.make_args(node.args[0])]
    high = any(power.is_Rational and abs(power.p) > HIGHEST_POWER for power in powers)
    return expr.count_ops() < MOST_OPERATIONS and len(roots | functions) <= MOST_GENERATORS and not high


def _factor_terms_of_fraction(expr: Expr) -> Expr:
    """One fraction, its numerator expanded and factored term by term: merges what 'together' leaves apart."""
    numerator, denominator = together(expr).as_numer_denom()
    return factor_terms(numerator.expand()) / denominator


def cancelling_sums(expr: Expr) -> int:
    """Count the sums within an expression whose terms are not known to have one sign."""
    risky = 0
    for total in expr.atoms(Add):
        one_sign = all(term.is_nonnegative for term in total.args) or all(term.is_nonpositive for term in total.args)
        risky += not one_sign
    return risky


def tidy(expr: Expr) -> Expr:
    """Write ``x sign(x)`` as ``abs(x)``, ``abs(x) sign(x)`` as ``x``, and what a kink leaves behind as a number.

    The derivative of ``sign`` is dropped, that of ``Min`` and ``Max`` is 0 or 1.
    """
    if expr.has(tanh):
        expr = expr.replace(1 - tanh(_any) ** 2, 1 / cosh(_any) ** 2).replace(tanh(_any) ** 2 - 1, -1 / cosh(_any) ** 2)
    expr = expr.replace(_is_log_near_one, lambda node: log1p(node.args[0] - 1))
    expr = expr.replace(DiracDelta, lambda *_: S.Zero)
    expr = expr.replace(Heaviside, lambda x, *_: Piecewise((S.One, x > 0), (S.Zero, True)))
    return expr.replace(lambda node: isinstance(node, Mul) and node.has(sign), _merge_signs)


def _is_log_near_one(node: Expr) -> bool:
    """Whether a node is log(1 + x) with x > 0, which log1p takes without loss at small x."""
    return isinstance(node, log) and isinstance(node.args[0], Add) and bool((node.args[0] - 1).is_positive)


def _merge_exp_minus_one(total: Expr) -> Expr:
    """Write ``c exp(x) - c`` within a sum as ``c expm1(x)``."""
    terms = list(total.args)
    for term in total.args:
        for exponential in term.atoms(exp):
            factor_ = term / exponential
            if term in terms and -factor_ in terms and not factor_.has(exponential):
                terms.remove(term)
                terms.remove(-factor_)
                terms.append(factor_ * expm1(exponential.args[0]))
    return Add(*terms)


def _merge_signs(product: Expr) -> Expr:
    factors = list(product.args)
    for factor_ in product.args:
        base, power = factor_.as_base_exp()
        if not (isinstance(base, sign) and power.is_integer and power.is_positive):
            continue
        argument = base.args[0]
        for partner, merged in ((argument, Abs(argument)), (Abs(argument), argument)):
            for other in product.args:
                other_base, other_power = other.as_base_exp()
                if other_base == partner and other_power.is_positive and other_power.is_integer:
                    factors.remove(factor_)
                    factors.remove(other)
                    rest = Mul(*factors, Pow(base, power - 1), Pow(other_base, other_power - 1), merged)
                    return _merge_signs(rest) if isinstance(rest, Mul) else rest
    return product
