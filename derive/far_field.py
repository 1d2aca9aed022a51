"""What of a law's friction exceeds the drags that its two particles have by themselves.

Input: a law. Output: the excess x, a function of h; where the scene has drag, a contact has x/(1 + x) of its friction.

Far apart, the friction of two particles that approach is no property of a contact: forces F and -F on particles of the
drags D1 and D2 make the centres approach at F (1/D1 + 1/D2), which is a friction of 1/(1/D1 + 1/D2); by Stokes,
6 pi eta R1 R2/(R1 + R2) = 3 pi eta R. A law's zeta that tends to this as h -> oo has it in it, and drag of the
particles beside it would count it twice: both frictions add, since the particles' motion and the closing of the gap
are one motion. So a contact carries what exceeds zeta's own limit,

    zeta (zeta_0 - zeta_oo)/zeta_0 = zeta x/(1 + x) ,     x = zeta_0/zeta_oo - 1

(of a scene with less drag than the law declares, that part of zeta_oo is taken away: (x + u)/(1 + x), u what is left
out of it), with zeta_0 = zeta at delta = 0 and zeta_oo its limit. At delta = 0 that is zeta_0 - zeta_oo. A film that is
pressed or pulled keeps the same fraction of its friction: then what is left is positive whatever the deflection, as
zeta_0 falls towards its limit; what it is less than zeta by is a fraction of the order of h/R near contact. (The
difference itself, zeta - zeta_oo, would be negative in a film that is pulled until it resists less.) x is found without
the sum that cancels: far away it is small, and so is its error.

A law whose zeta tends to 0 has nothing to take away. One whose zeta grows without bound, or tends to no limit, holds
distant particles together: with drag it needs a range of contacts.

That x is positive is checked, not proved: in 60 digits, at 25 gaps from 1e-8 to 1e16 R and at the size ratios of
:data:`SIZE_RATIOS`; between these, and at other parameters than the typical ones, it is not.

What is left falls as R/h, as the exact friction of two spheres does. Of many, no sum over pairs represents that: it
grows with their number. So scenes with drag end their contacts at 200 radii where they give no range of their own.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import mpmath
import numpy as np
from sympy import Add, Expr, Mul, Pow, Rational, S, Symbol, expand, factor, factor_terms, lambdify, limit, oo, simplify
from sympy.codegen.cfunctions import expm1, log1p

from softdyn.derivations import kept
from softdyn.derive.law import sample_values
from softdyn.derive.soundness import sound, tidy
from softdyn.derive.special import IN_NUMPY
from softdyn.derive.symbols import E, R, a, delta, eta, h, size_ratio
from softdyn.errors import LawError

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

#: R/h. No parameter of a law can have this name, which is no identifier.
NEARNESS = Symbol("R/h", positive=True)
#: Gaps, in radii, at which the derived excess is compared with the law in many digits.
GAPS = tuple(10.0**power for power in range(-8, 17))
#: Relative error of x in double precision there.
ROUNDING = 1e-11
#: At a gap of 1e30 radii nothing but this may be left of x.
LEFT = 1e-4
#: Size ratios of unequal particles for which it is: 0, of a wall, to 1/4.
SIZE_RATIOS = (S.Zero, Rational(1, 20), Rational(1, 4))


def undeflected_friction(law: ContactLaw, unequal: bool = False) -> Expr:
    """Friction of surfaces that are not deflected, a function of h, and of ``size_ratio`` for unequal particles."""
    friction = law.zeta * law.unequal if unequal else law.zeta
    return friction.subs(a, law.a).subs(delta, 0)


@cache
def far_friction(law: ContactLaw) -> Expr:
    """Limit of zeta at delta = 0 as h -> oo: 0, oo, a positive expression, or ``nan`` where none is found."""
    return kept("far_friction", (law.a, law.zeta), lambda: _far_friction(law))


def _far_friction(law: ContactLaw) -> Expr:
    # what the gap does not enter is kept from sympy's polynomials: with hundreds of parameters they recurse too deeply
    constant, varying = undeflected_friction(law).subs(h, R / NEARNESS).as_independent(NEARNESS, as_Add=False)
    for simpler in (True, False):
        try:
            found = constant * limit(factor(simplify(varying)) if simpler else varying, NEARNESS, 0, "+")
        except (NotImplementedError, ValueError, TypeError, AttributeError, RecursionError):
            continue
        if found in (S.Zero, oo) or (found.is_finite is not False and not found.has(NEARNESS, S.NaN, oo)):
            return found
    return S.NaN


@cache
def relative_excess(law: ContactLaw, unequal: bool = False) -> Expr:
    """Return x = zeta_0/zeta_oo - 1, for a law with a limit that is neither 0 nor oo, in a form that does not cancel.

    Raises
    ------
    LawError
        If there is no such form, or x is not positive.
    """
    given = (law.a, law.zeta, law.unequal, sample_values(law), unequal)
    return kept("relative_excess", given, lambda: _relative_excess(law, unequal))


def _relative_excess(law: ContactLaw, unequal: bool) -> Expr:
    ratio = (undeflected_friction(law, unequal) / far_friction(law)).subs(h, R / NEARNESS)
    plain = simplify(ratio)
    forms = [expand(plain) - 1, expand(simplify(plain - 1)), factor(simplify(plain - 1)), plain - 1]
    if isinstance(plain, Pow):
        forms.insert(0, expm1(plain.exp * log1p(factor(plain.base - 1))))
    candidates = [sound(factor_terms(form.subs(NEARNESS, R / h))) for form in forms]
    if unequal:
        # the law's own sum term by term, as it is written: the forms above spread it out
        parts = (part if part.is_Add else simplify(part) for part in Mul.make_args(ratio))
        terms = Add.make_args((Mul(*parts) - 1).subs(NEARNESS, R / h))
        candidates.insert(0, Add(*(tidy(term) for term in terms)))
    # of no use beyond the range of contacts, which few scenes have so large: second best is a form that is exact there
    for farthest in (GAPS[-1], 1e4):
        for candidate in candidates:
            if all(_agrees(law, candidate, farthest, size) for size in (SIZE_RATIOS if unequal else (None,))):
                return candidate
    raise LawError(
        law.name,
        (
            "with drag its contacts carry what zeta exceeds its limit far apart by, and no form of that is found that "
            "does not cancel: write zeta as its limit times 1 plus what vanishes far apart",
        ),
    )


def is_bounded(law: ContactLaw) -> bool:
    """Whether the friction of distant particles has a limit: if not, the contacts of a scene with drag need a range."""
    return far_friction(law) not in (oo, S.NaN)


def excess(law: ContactLaw, unequal: bool = False) -> Expr | None:
    """By how much zeta exceeds its limit far apart, relative to it; None where contacts carry all of zeta.

    Raises
    ------
    LawError
        If zeta does not exceed its limit, or no sound form of that is found.
    """
    return relative_excess(law, unequal) if is_bounded(law) and far_friction(law) != 0 else None


def _agrees(law: ContactLaw, candidate: Expr, farthest: float, size: Rational | None) -> bool:
    """Whether x, in double precision, is what the law says in many digits up to a gap; refuse x <= 0."""
    values = {R: S.One, E: S.One, eta: S.One, **sample_values(law)}
    values |= {} if size is None else {size_ratio: size}
    exact = (undeflected_friction(law, size is not None) / far_friction(law)).subs(values)
    exactly = lambdify(h, exact, "mpmath")
    with np.errstate(all="ignore"):
        in_doubles = np.broadcast_to(
            lambdify(h, candidate.subs(values), [IN_NUMPY, "numpy"])(np.array(GAPS)), len(GAPS)
        )
    with mpmath.workdps(60):
        expected = [exactly(mpmath.mpf(gap)) - 1 for gap in GAPS]
        left = abs(exactly(mpmath.mpf(10) ** 30) - 1)
        errors = [
            abs(float(found) / one - 1) if one else mpmath.inf for found, one in zip(in_doubles, expected, strict=True)
        ]
    wrong = [gap for gap, one in zip(GAPS, expected, strict=True) if one <= 0]
    if wrong:
        raise LawError(
            law.name,
            (
                f"with drag its contacts carry what zeta exceeds its limit far apart by, {far_friction(law)}, and at "
                f"h = {wrong[0]:g} R and delta = 0 it is not above that",
            ),
        )
    far = max(error for gap, error in zip(GAPS, errors, strict=True) if gap <= farthest)
    return bool(left < LEFT and far < ROUNDING)
