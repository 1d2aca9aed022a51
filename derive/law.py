"""Declaring a contact law.

A law is four expressions, eqs. 3 to 6 of Rognon & Gay, arXiv 0803.1573, and nothing else is assumed of it::

    a(h, delta)   F_ela(a, delta)   zeta(a, h)   F_adh(a, h)

A law that is declared ``general`` has F_ela(a, delta, h) and F_adh(a, h, delta) instead. A dry contact, zeta = 0, has
no gap of its own: see :mod:`softdyn.derive.gapless_equations` for many of them, with a ``dashpot`` or without.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from hashlib import sha256
from typing import Any

from sympy import Basic, Expr, Integer, Interval, Matrix, Rational, S, Symbol, oo, srepr

from softdyn.derive.branches import in_plain_functions
from softdyn.derive.checks import faults_of, undecided_signs
from softdyn.derive.dimensions import DIMENSIONLESS, Dimension
from softdyn.derive.sphere import drag_of_sphere, torque_of_sphere
from softdyn.derive.symbols import COMMON_PARAMETERS, DERIVED, DIMENSIONS, Parameter, R, delta, size_ratio
from softdyn.errors import LawError
from softdyn.verdicts import found_of


def _exact(value: Any) -> Any:
    """An expression in the functions that all targets have; an integer as sympy's."""
    if isinstance(value, int) and not isinstance(value, bool):
        return Integer(value)
    return in_plain_functions(value) if isinstance(value, Expr) else value


@dataclass(frozen=True)
class Limit:
    """What a law's author claims of one asymptotic regime.

    Parameters
    ----------
    name : str
        For instance "Hertz".
    order : tuple of Expr, or tuple of such tuples
        From the smallest to the largest: ``(h, delta, R)`` stands for h << delta << R, and ``((delta, h, R), (F, A))``
        for delta << h << R and F << A. Besides h, delta, F and R, products of powers of these and of parameters may
        stand in it, of their exponentials and logarithms too, as in ``(A*exp(-h/ell), F)``; ``-delta`` and ``-F`` in
        tension. What it does not name is fixed. All inequalities sharpen, each at its own rate: ell << h alone says
        nothing of how exp(-h/ell) compares with other ratios.
    claims : mapping from str to Expr
        Leading form of any of ``a``, ``zeta``, ``delta``, ``F``, ``F_adh``, ``C``, ``D``, ``dh_dt``, ``dX_dt``, in h,
        delta, F (or kappa) and the parameters; ``dX_dt`` at constant force.
    within : mapping from str to number
        Claimed errors of some of them, relative to the form: ``{"zeta": 0.05}``, "within 5 %".
    where : mapping from Expr to number
        For which ratios, each below a number: ``{h/R: 1e-3, delta/h: 1e-2}``. Where it is left out the largest box is
        found, all ratios of the order below one number. See :mod:`softdyn.derive.error_bounds`.
    """

    name: str
    order: tuple[Expr, ...] | tuple[tuple[Expr, ...], ...]
    claims: Mapping[str, Expr]
    within: Mapping[str, Any] = field(default_factory=dict)
    where: Mapping[Expr, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        exact = {name: _exact(form) for name, form in self.claims.items()}
        object.__setattr__(self, "claims", exact)
        for name in ("within", "where"):
            # a number as it is written, 0.05 being 1/20
            numbers = {key: Rational(str(value)) for key, value in getattr(self, name).items()}
            object.__setattr__(self, name, numbers)


@dataclass(frozen=True, eq=False)
class Tangential:
    """What a contact does to tangential motion: sliding friction in series with tangential elasticity, and rolling.

    All are functions of a and h, and but for k_t of ``size_ratio``. With D = (R1 - R2)/(R1 + R2), surfaces that slide
    at the velocity u and roll at w = (omega1 - omega2) x n exert the force sliding u + D coupling w and the moment
    D coupling u + rolling w: see :mod:`softdyn.derive.tangential`.

    Parameters
    ----------
    sliding : Expr
        Friction coefficient of sliding, force/velocity. ``oo`` where no film is between the surfaces, which stick then,
        as far as friction holds them.
    k_t : Expr
        Tangential stiffness of the contact, force/length: of both surfaces together.
    coupling, rolling : Expr or int
        Friction coefficients of the coupling, force, and of rolling, force times length, each per velocity.
    """

    sliding: Expr
    k_t: Expr
    coupling: Expr = S.Zero
    rolling: Expr = S.Zero

    def __post_init__(self) -> None:
        for name, value in tangential_expressions(self).items():
            object.__setattr__(self, name, _exact(value))


def tangential_expressions(tangential: Tangential) -> dict[str, Expr]:
    """Return the declared expressions, by name."""
    return {name: getattr(tangential, name) for name in ("sliding", "coupling", "rolling", "k_t")}


@dataclass(frozen=True)
class Rubbing:
    """Surfaces that touch through their film and rub, in scenes of many particles with Coulomb friction.

    They bear the ``load`` as they touch, are joined by a tangential spring, and slide where it would bear more than
    mu load: see :mod:`softdyn.derive.coulomb`. A dry law that declares nothing has the force of the contact for a load,
    and the ``k_t`` of its :class:`Tangential`.

    Parameters
    ----------
    load : Expr
        Normal force between the surfaces themselves, 0 where they do not touch: a function of a, h and delta, that
        part of the law's force which is not the film's.
    k_t : Expr
        Tangential stiffness of what touches, force/length, a function of a, h and delta.
    mu : Expr or int
        Coefficient of friction over that of the scene, [friction] mu: a function of h and of ``slip_rate``.
    """

    load: Expr
    k_t: Expr
    mu: Expr = S.One

    def __post_init__(self) -> None:
        for name, value in rubbing_expressions(self).items():
            object.__setattr__(self, name, _exact(value))


def rubbing_expressions(rubbing: Rubbing) -> dict[str, Expr]:
    """Return the declared expressions, by name."""
    return {name: getattr(rubbing, name) for name in ("load", "k_t", "mu")}


#: Drag and torque on a sphere alone.
ALONE, TURNING = drag_of_sphere(R), torque_of_sphere(R)


@dataclass(frozen=True)
class Drag:
    """What the fluid does to a particle alone, in scenes of many particles that ask for it: by Stokes, if not declared.

    Both are functions of R, the radius of the particle, eta, and the law's parameters.

    Parameters
    ----------
    translation : Expr
        Resistance to a motion relative to the background flow, force/velocity.
    rotation : Expr
        Resistance to a rotation relative to that of the flow, torque/angular velocity.
    """

    translation: Expr = ALONE
    rotation: Expr = TURNING

    def __post_init__(self) -> None:
        for name, value in drag_expressions(self).items():
            object.__setattr__(self, name, _exact(value))


def drag_expressions(drag: Drag) -> dict[str, Expr]:
    """Return the declared expressions, by name."""
    return {name: getattr(drag, name) for name in ("translation", "rotation")}


@dataclass(frozen=True, eq=False)
class ContactLaw:
    """A contact law: four sympy expressions in the symbols of :mod:`softdyn.derive.symbols`.

    Parameters
    ----------
    name : str
        A lower-case identifier; it names the generated files and functions.
    a : Expr
        Radius of the interacting region, a function of h and delta.
    F_ela : Expr
        Elastic force, a function of a and delta (of h too, if ``general``); > 0 in compression. ``oo`` declares rigid
        particles: delta = 0.
    zeta : Expr
        Normal friction coefficient, a function of a and h. 0 declares a dry contact: h = 0.
    F_adh : Expr or int
        Remote force, a function of a and h (of delta too, if ``general``); > 0 is repulsive. In a dry contact it acts
        beside F_ela, with h = 0 where surfaces touch.
    dashpot : Expr or int
        Of a dry contact: friction coefficient beside F_ela where surfaces touch, a function of a and delta, which
        resists the rate of the distance of the centres.
    tangential : Tangential, optional
        What tangential motion meets, in scenes of many particles that ask for it.
    rubbing : Rubbing, optional
        Where surfaces touch and rub, in scenes with Coulomb friction.
    drag : Drag
        What the fluid does to a particle alone, likewise.
    unequal : Expr or int
        Friction of two particles of different radii, or of one and a wall, over zeta, which is that of two equal ones
        with the same R: a function of h and ``size_ratio``, 1 where that is 1/4.
    parameters : mapping from Symbol to Dimension
        The law's own parameters, besides R, E and eta, which any law may use; any identifier names one but those of
        the paper's symbols. What has the name of something that is derived, as C and D, is shown as own_C.
    ranges : mapping from Symbol to (low, high), or to Interval
        Values that a parameter may take, where that is not "any positive number" (or "any number", for a symbol
        declared real): between two finite numbers, without these; or a sympy ``Interval``, whose ends may belong to it.
    typical : mapping from Symbol to Expr
        Typical values of the law's own parameters, numbers other than 0 times powers of R, E and eta: their orders of
        magnitude tell which regimes there are, and pictures are drawn for them.
    general : bool
        Whether the paper's restriction is lifted: F_ela(a, delta, h) may depend on the gap, as that of a soft layer,
        and be a force at delta = 0, as in JKR's theory; F_adh(a, h, delta) may depend on the deflection, as in that of
        Maugis. F_ela must still rise with delta at any gap.
    limits : tuple of Limit
        What the author claims of the law; ``softdyn check`` proves or disproves it.
    source : str
        Where the law comes from.
    description : str
        One line for ``softdyn laws``.

    Raises
    ------
    LawError
        Listing every fault: a wrong argument, a wrong dimension, a function that a target cannot print,
        C <= 0 or zeta <= 0 somewhere within h > 0, abs(delta) < R, with numbers that show it. C may vanish at delta = 0
        alone. Where neither this nor the contrary can be proved, a warning names the box that is left.
    """

    name: str
    a: Expr
    F_ela: Expr
    zeta: Expr
    F_adh: Expr = S.Zero
    dashpot: Expr = S.Zero
    tangential: Tangential | None = None
    rubbing: Rubbing | None = None
    drag: Drag = Drag()
    unequal: Expr = S.One
    parameters: Mapping[Symbol, Dimension] = field(default_factory=dict)
    ranges: Mapping[Symbol, Interval | tuple[Expr | int, Expr | int]] = field(default_factory=dict)
    typical: Mapping[Symbol, Expr | int] = field(default_factory=dict)
    general: bool = False
    limits: tuple[Limit, ...] = ()
    source: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        for name, value in {**expressions(self), "dashpot": self.dashpot, "unequal": self.unequal}.items():
            object.__setattr__(self, name, _exact(value))
        object.__setattr__(self, "limits", tuple(self.limits))
        own = self.parameters if isinstance(self.parameters, Mapping) else {}
        apart = {
            symbol: Parameter(symbol.name, **symbol.assumptions0)
            for symbol in own
            if isinstance(symbol, Symbol) and symbol.name in DERIVED
        }
        for item in fields(self) if apart else ():
            object.__setattr__(self, item.name, _renamed(getattr(self, item.name), apart))
        faults, undecided = found_of(self, faults_of, undecided_signs)
        if faults:
            raise LawError(str(self.name), tuple(faults))
        for words in undecided:
            warnings.warn(f"law {self.name!r}: {words}", stacklevel=3)

    def _repr_latex_(self) -> str:
        from softdyn.derive.typeset import declaration_latex

        return declaration_latex(self)


def _renamed(value: Any, names: Mapping[Symbol, Symbol]) -> Any:
    """What is declared, with other symbols for some."""
    if isinstance(value, Basic):
        return value.xreplace(names)
    if isinstance(value, Mapping):
        return {_renamed(key, names): _renamed(content, names) for key, content in value.items()}
    if isinstance(value, (tuple, list)):
        return tuple(_renamed(part, names) for part in value)
    if isinstance(value, (Limit, Tangential, Rubbing, Drag)):
        return replace(value, **{item.name: _renamed(getattr(value, item.name), names) for item in fields(value)})
    return value


def code_names(law: ContactLaw) -> dict[str, str]:
    """Names of the law's parameters in generated code: own_NAME, so that none is that of anything else there."""
    names = {symbol.name: symbol.name for symbol in (*COMMON_PARAMETERS, size_ratio)}
    for symbol in law.parameters:
        name = "own_" + re.sub(r"[^A-Za-z0-9_]", "_", symbol.name)
        # own_x_p2 would be the square of own_x
        while re.search(r"_p\d+$", name) or name in names.values():
            name += "_"
        names[symbol.name] = name
    return names


@lru_cache(maxsize=32)
def in_code(law: ContactLaw) -> ContactLaw:
    """Return the law with its own parameters named as in generated code."""
    named = copy(law)
    names = code_names(law)
    own = {symbol: Symbol(names[symbol.name], **symbol.assumptions0) for symbol in law.parameters}
    for item in fields(law):
        object.__setattr__(named, item.name, _renamed(getattr(law, item.name), own))
    return named


def is_rigid(law: ContactLaw) -> bool:
    """Whether the particles do not deform: F_ela = oo, delta = 0."""
    return bool(law.F_ela == oo)


def is_dry(law: ContactLaw) -> bool:
    """Whether no fluid resists: zeta = 0, and the gap is closed, h = 0."""
    return bool(law.zeta == 0)


def is_anchored(law: ContactLaw) -> bool:
    """Whether F_ela vanishes at delta = 0, so that force and deflection have one sign."""
    return is_rigid(law) or law.F_ela.subs(delta, 0) == 0


def ranges_of(law: ContactLaw) -> dict[Symbol, Interval]:
    """Values that parameters may take, where the law declares a range."""
    return {
        symbol: bounds if isinstance(bounds, Interval) else Interval.open(*bounds)
        for symbol, bounds in law.ranges.items()
    }


def range_text(symbol: object, allowed: Interval) -> str:
    """Words for a range, as "-1 < nu <= 1/2"."""
    signs = ["<" if is_open else "<=" for is_open in (allowed.left_open, allowed.right_open)]
    return f"{allowed.start} {signs[0]} {getattr(symbol, 'name', symbol)} {signs[1]} {allowed.end}"


def plain_ranges(law: ContactLaw) -> dict[str, list[Any]]:
    """Ranges as plain data, by the parameters' names: low, high, and whether each of these is itself left out."""
    return {
        symbol.name: [float(one.start), float(one.end), bool(one.left_open), bool(one.right_open)]
        for symbol, one in ranges_of(law).items()
    }


@lru_cache(maxsize=128)
def parameters_of(
    law: ContactLaw, tangential: bool = False, drag: bool = False, rubbing: bool = False
) -> tuple[Symbol, ...]:
    """Parameters that the law uses, R always among them: R, E, eta, then its own by name.

    Parameters
    ----------
    law : ContactLaw
    tangential, drag, rubbing : bool
        Whether those of tangential motion, of the drag, and of surfaces that rub are meant, too.
    """
    used = {R}.union(*(expr.free_symbols for expr in (*expressions(law).values(), law.dashpot)))
    if tangential and law.tangential is not None:
        used = used.union(*(expr.free_symbols for expr in tangential_expressions(law.tangential).values()))
    if rubbing and law.rubbing is not None:
        used = used.union(*(expr.free_symbols for expr in rubbing_expressions(law.rubbing).values()))
    elif rubbing and law.tangential is not None:
        used = used.union(law.tangential.k_t.free_symbols)
    if drag:
        used = used.union(*(expr.free_symbols for expr in drag_expressions(law.drag).values()))
    common = [symbol for symbol in COMMON_PARAMETERS if symbol in used]
    own = sorted((symbol for symbol in used if symbol in law.parameters), key=lambda symbol: symbol.name)
    return (*common, *own)


def dimensions_for(law: ContactLaw) -> dict[Symbol, Dimension]:
    """Dimensions of every symbol that the law may use."""
    return {**DIMENSIONS, **law.parameters}


def expressions(law: ContactLaw) -> dict[str, Expr]:
    """Return the four declared expressions, by name."""
    return {"a": law.a, "F_ela": law.F_ela, "zeta": law.zeta, "F_adh": law.F_adh}


@lru_cache(maxsize=64)
def typical_values(law: ContactLaw) -> Mapping[Symbol, Rational]:
    """Return the typical values of the law's own parameters, in units R = E = eta = 1."""
    units = dict.fromkeys(COMMON_PARAMETERS, 1)
    return {symbol: Rational(S(value).subs(units)) for symbol, value in law.typical.items()}


def without_typical(law: ContactLaw) -> tuple[Symbol, ...]:
    """Own parameters that the law uses, and gives no typical value of."""
    return tuple(symbol for symbol in parameters_of(law) if symbol not in (*law.typical, *COMMON_PARAMETERS))


def sizes_asked(law: ContactLaw) -> tuple[Symbol, ...]:
    """Own parameters without a typical value that are small or large against others: regimes depend on their sizes.

    A pure number counts as of order one; so does a surface tension that no other force or pressure can be compared
    with.
    """
    used = parameters_of(law)
    dimensions = dimensions_for(law)
    asked = tuple(symbol for symbol in without_typical(law) if dimensions[symbol] != DIMENSIONLESS)

    def ratios(symbols: Iterable[Symbol]) -> int:
        rows = [[dimensions[s].mass, dimensions[s].length, dimensions[s].time] for s in symbols]
        return int(len(rows) - Matrix([[Rational(p.numerator, p.denominator) for p in row] for row in rows]).rank())

    return asked if ratios(used) > ratios(symbol for symbol in used if symbol not in asked) else ()


@lru_cache(maxsize=64)
def sample_values(law: ContactLaw) -> Mapping[Symbol, Rational]:
    """Values of the law's own parameters, typical or at least allowed and different, in units R = E = eta = 1."""
    values, ranges = {}, ranges_of(law)
    for i, symbol in enumerate(law.parameters):
        allowed = ranges.get(symbol, Interval(0, 1))
        low, high = Rational(allowed.start), Rational(allowed.end)
        values[symbol] = low + (high - low) * Rational(3 + 2 * i, 7 + 2 * i)
    return {**values, **typical_values(law)}


def law_hash(law: ContactLaw) -> str:
    """Fingerprint of what the law's kernels depend on: its name, source, expressions and parameters."""
    ranges = ranges_of(law)
    own = [f"{srepr(symbol)}: {law.parameters[symbol]} {ranges.get(symbol)}" for symbol in law.parameters]
    text = "\n".join([law.name, law.source, *(srepr(expr) for expr in expressions(law).values()), *own])
    return sha256(text.encode()).hexdigest()[:16]


def particles_hash(law: ContactLaw) -> str:
    """Fingerprint of what kernels of many particles may depend on besides: tangential motion, drag, different radii."""
    declared = drag_expressions(law.drag)
    if law.tangential is not None:
        declared |= tangential_expressions(law.tangential)
    if law.rubbing is not None:
        declared |= {f"rubbing {name}": expr for name, expr in rubbing_expressions(law.rubbing).items()}
    declared |= {"unequal": law.unequal} | ({} if law.dashpot == 0 else {"dashpot": law.dashpot})
    text = "\n".join(f"{name} {srepr(expr)}" for name, expr in declared.items())
    return sha256(text.encode()).hexdigest()[:16]
