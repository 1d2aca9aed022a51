"""The asymptotic regimes of a law in the plane of gap and force, discovered from its four expressions.

Input: a law. Output: its regimes, each with the leading forms of every quantity, the next corrections and the local
exponents; the crossovers, on which two regimes' leading forms are equal; the points where several meet.

The plane of scalings h = R eps^p, |delta| = R eps^s is cut into cones until one term dominates each sum in each of them
(:mod:`softdyn.derive.dominant_balance`); cones with the same leading forms are one regime. In each the force balance is
a monomial equation, solved exactly for delta(h, F). Parameters of the law's own that are not of order one, in units of
R, E and eta, scale too, each with the power of eps that its typical value has: a third axis for all of them together.
One that is an exponent, as n in delta^n, has its typical value.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations, count
from typing import TYPE_CHECKING, Literal

import mpmath
from sympy import Add, Eq, Expr, Float, Mul, Rational, S, Symbol, diff, exp, lambdify, log, powsimp, simplify

from softdyn.derive import dynamics as d
from softdyn.derive.asymptotics import (
    KEPT,
    MOST_OPERATIONS,
    OutOfEffortError,
    Scale,
    Series,
    UndecidedError,
    added,
    expand,
    is_zero,
    leading,
    minimal,
    minus,
    multiplied,
    raised,
    scale_of,
    zero,
)
from softdyn.derive.checks import pressed_only
from softdyn.derive.cones import (
    Cone,
    Normal,
    Ray,
    cut,
    dot,
    hull_normals,
    merged,
    orthants,
    primitive,
    shared_facets,
    simpler,
)
from softdyn.derive.dimensions import DIMENSIONLESS, powers_of_units
from softdyn.derive.dominant_balance import QUANTITIES, contact_series, definitions, settle, size
from softdyn.derive.forms import force, force_unit, joined_logarithms
from softdyn.derive.law import (
    is_anchored,
    is_dry,
    is_rigid,
    parameters_of,
    ranges_of,
    sample_values,
    sizes_asked,
    typical_values,
)
from softdyn.derive.patience import within
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.symbolic_powers import exponents_of, exponents_words, with_exponents
from softdyn.derive.symbols import COMMON_PARAMETERS, E, F, R, a, delta, eta, h
from softdyn.derive.witness import EXPONENTIAL, inequalities, side_of
from softdyn.words import in_columns

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw, Limit

Side = Literal["compression", "tension"]
SIGN: dict[Side, int] = {"compression": 1, "tension": -1}

#: Quantities that a regime has a leading form of, in the order in which they are shown.
FORMS = ("a", "zeta", "delta", "F_adh", "C", "D", "dh_dt", "dX_dt", "U_h")

#: In which order quantities are asked where two regimes meet.
MEETING = ("delta", "dh_dt", "zeta", "a", "C", "D", "dX_dt", "F_adh", "U_h")

#: Terms of a series kept to see the next corrections.
CORRECTION_TERMS = 4

#: Operations after which what is not yet decided is given up, on each side of the plane: of all leading terms, of all
#: corrections, and of what follows from them; and the part of that which each cone may take.
EFFORT, SHARE = 200_000, 10

#: Decades by which a parameter must differ from 1, in units of R, E and eta, to count as small or large; and by which a
#: pure number must, as a Poisson ratio of 0.3 does not.
SEPARATION, OF_NUMBERS = 0.5, 1.0


@dataclass(frozen=True)
class Form:
    """Leading form of a quantity in a regime.

    Attributes
    ----------
    leading : Expr
        In h, F and the parameters; here F and delta stand for their sizes, in tension too.
    state : Expr
        The same, in h and delta.
    corrections : tuple of Expr
        The largest next terms, relative to the leading one, in h and F; several, where it depends on the scaling which
        is the largest. None, if the form is exact up to less than any power.
    resolved : bool
        Whether the coefficients of the largest corrections are known in the whole regime.
    """

    leading: Expr
    state: Expr
    corrections: tuple[Expr, ...] = ()
    resolved: bool = True


@dataclass(frozen=True)
class Condition:
    """One of a regime's defining inequalities: ``small`` << ``large``, lengths or forces, in h and F.

    In h and the size of delta, where the force is undecided.
    """

    small: Expr
    large: Expr

    @property
    def ratio(self) -> Expr:
        """Return small/large: below 1 inside."""
        return powsimp(self.small / self.large)

    def __str__(self) -> str:
        return f"{self.small} << {self.large}"


@dataclass(frozen=True)
class Regime:
    """A region of the plane of h and F with one leading form for each quantity.

    Attributes
    ----------
    name : str
        That of the claimed limit that lies in it; else a number.
    side : "compression" or "tension"
    inside : bool
        Whether some of it has delta << R; what has not lies outside the model.
    conditions : tuple of Condition
    forms : mapping from str to Form
        Of :data:`FORMS`, those that could be decided and are not zero.
    undecided : mapping from str to str
        Why there is no form of the others.
    lambda1, lambda2 : Expr or None
        dln(delta)/dln(h) and dln(dh/dt)/dln(h) of the leading forms, at constant force.
    balance : Expr or None
        Leading form of F, in h and delta.
    edge : Expr or None
        The force at which delta = R, in h, where the regime reaches so far: the edge of the model.
    cones : tuple of Cone
        In the exponents of h, of delta and, if there is a third axis, of the parameters.
    """

    name: str
    side: Side
    inside: bool
    conditions: tuple[Condition, ...]
    forms: Mapping[str, Form]
    undecided: Mapping[str, str]
    lambda1: Expr | None
    lambda2: Expr | None
    balance: Expr | None
    edge: Expr | None
    cones: tuple[Cone, ...]

    @property
    def delta(self) -> Expr:
        """Return the leading form of the deflection's size, in h and F."""
        return self.forms["delta"].leading

    @property
    def dh_dt(self) -> Expr:
        """Return the leading form of the gap's rate, in h and F."""
        return self.forms["dh_dt"].leading


@dataclass(frozen=True)
class Crossover:
    """Where two regimes meet.

    Attributes
    ----------
    first, second : str
    quantity : str
        The one whose leading forms are equal there: delta, unless it has the same form on both sides.
    line : Eq
        F = ... in h, or h = ... where F drops out.
    others : mapping from str to Expr
        For the other quantities whose forms meet elsewhere: the right-hand side that they would give.
    facet : Normal
        Of the face that the regimes' cones share, pointing into the first.
    """

    first: str
    second: str
    side: Side
    quantity: str
    line: Eq
    others: Mapping[str, Expr]
    facet: Normal


@dataclass(frozen=True)
class Meeting:
    """A point where three or more regimes meet."""

    regimes: tuple[str, ...]
    side: Side
    h: Expr
    force: Expr


@dataclass(frozen=True)
class Diagram:
    """The regimes of a law and what lies between them.

    Attributes
    ----------
    law : ContactLaw
    regimes : tuple of Regime
    crossovers : tuple of Crossover
    points : tuple of Meeting
    conservative : bool or None
        Whether U_h = 0 (physics: the elastic energy depends on delta alone); None if that is not known.
    scales : mapping from Symbol to int
        Powers of eps with which the law's own parameters scale.
    exponents : mapping from Symbol to Rational
        Typical values of parameters that are exponents, as n in delta^n: regimes are those at these values.
    """

    law: ContactLaw
    regimes: tuple[Regime, ...]
    crossovers: tuple[Crossover, ...]
    points: tuple[Meeting, ...]
    conservative: bool | None
    scales: Mapping[Symbol, int]
    exponents: Mapping[Symbol, Rational] = field(default_factory=dict)

    def regime(self, name: str, side: Side = "compression") -> Regime:
        """Return a regime by its name."""
        return next(regime for regime in self.regimes if (regime.name, regime.side) == (name, side))

    def __str__(self) -> str:
        """One line for each regime: where it is, and the leading forms of delta and dh/dt at a given force."""
        rows = []
        for one in self.regimes:
            forms = (f"{name} = {one.forms[name].leading}" for name in ("delta", "dh_dt") if name in one.forms)
            rows.append((f"{one.side}: {one.name}", ", ".join(map(str, one.conditions)), ", ".join(forms)))
        return in_columns(rows) + (f"\n{exponents_words(self.exponents)}" if self.exponents else "")

    def _repr_html_(self) -> str:
        from softdyn.derive.typeset import diagram_html
        from softdyn.study.presence import presence_of

        return diagram_html(self, {key for key, found in presence_of(self).items() if not found.there})


#: Why a law with a force at delta = 0 has no diagram.
UNANCHORED = "F_ela is not 0 at delta = 0, so that force and deflection may have opposite signs"


def sizes_words(asked: Sequence[Symbol]) -> str:
    """Why a law has no diagram that gives no typical values of some parameters."""
    names = ", ".join(map(str, asked))
    return f"the law gives no typical value of {names}; which regimes there are depends on whether these are small"


def discover(law: ContactLaw, effort: int = EFFORT) -> Diagram:
    """Find every regime of a law, the crossovers between them and the points where several meet.

    Parameters
    ----------
    law : ContactLaw
    effort : int
        Operations after which what is not yet decided is left undecided.

    Returns
    -------
    Diagram
        What the method cannot decide is listed with the reason, in each regime's ``undecided``.
    """
    exponents = exponents_of(law, _directions(law)[1])
    found = _found(with_exponents(law, exponents), effort)
    return replace(found, law=law, exponents=exponents) if exponents else found


def _found(law: ContactLaw, effort: int) -> Diagram:
    directions, scales = _directions(law)
    if not is_anchored(law):
        return _nothing_found(law, directions, scales, UNANCHORED)
    if asked := sizes_asked(law):
        return _nothing_found(law, directions, scales, sizes_words(asked))
    try:
        with knowing_ranges(ranges_of(law)):
            return _discovered(law, directions, scales, effort)
    except UndecidedError as reason:
        return _nothing_found(law, directions, scales, str(reason))


def _nothing_found(
    law: ContactLaw, directions: Mapping[Symbol, Normal], scales: Mapping[Symbol, int], reason: str
) -> Diagram:
    """Return the diagram of a law that was given up: nothing is decided anywhere."""
    cones = tuple(orthants(len(directions[h]), positive=(2,) if scales else ()))
    undecided = dict.fromkeys(FORMS, reason)
    whole = [
        Regime("whole", side, True, (), {}, undecided, None, None, None, None, cones) for side in sides_with_forces(law)
    ]
    return Diagram(law, tuple(whole), (), (), None, scales)


def _discovered(
    law: ContactLaw, directions: Mapping[Symbol, Normal], scales: Mapping[Symbol, int], effort: int
) -> Diagram:
    conservative = is_conservative(law)
    found: list[Regime] = []
    crossovers: list[Crossover] = []
    points: list[Meeting] = []
    for side in sides_with_forces(law):
        here = _regimes(law, side, directions, effort, bool(conservative), found)
        with within(effort, OutOfEffortError):
            met = list(_crossovers(law, here, directions))
            found += [replace(regime, conditions=_conditions(law, regime, here, met, directions)) for regime in here]
            crossovers += met
            points += _points(here, met)
    return Diagram(law, tuple(found), tuple(crossovers), tuple(points), conservative, scales)


def sides_with_forces(law: ContactLaw) -> tuple[Side, ...]:
    """Sides on which a law has forces: compression alone, if it says nothing of surfaces that are pulled."""
    return ("compression",) if pressed_only(law) else ("compression", "tension")


def _directions(law: ContactLaw) -> tuple[dict[Symbol, Normal], dict[Symbol, int]]:
    """Exponents of h, delta and the parameters as linear forms of the axes; powers of eps of the parameters alone.

    A parameter scales if the law gives a typical value of it, in units of R, E and eta, that is far from 1.
    """
    decades = {s: -math.log10(abs(float(value))) for s, value in typical_values(law).items() if value}
    least = {s: OF_NUMBERS if law.parameters.get(s) == DIMENSIONLESS else SEPARATION for s in decades}
    apart = sorted((s for s in decades if abs(decades[s]) >= least[s]), key=lambda s: (decades[s], s.name))
    if not apart:
        return {h: (1, 0), size: (0, 1)}, {}
    # what differs by less than that is of one order: exp(s0/ell) is not infinite for s0 = 2 ell
    alike: list[list[Symbol]] = []
    for symbol in apart:
        if alike and decades[symbol] - decades[alike[-1][-1]] < SEPARATION:
            alike[-1].append(symbol)
        else:
            alike.append([symbol])
    scales: dict[Symbol, int] = {}
    for group in _tied(law, alike):
        mean = sum(decades[symbol] for symbol in group) / len(group)
        scales |= dict.fromkeys(group, round(2 * mean) or (1 if mean > 0 else -1))
    whole = primitive(list(scales.values()))
    scales = dict(zip(scales, whole, strict=True))
    return {h: (1, 0, 0), size: (0, 1, 0), **{symbol: (0, 0, power) for symbol, power in scales.items()}}, scales


def directions_of(diagram: Diagram) -> dict[Symbol, Normal]:
    """Exponents of h, delta and the parameters as linear forms of the axes of a diagram's cones."""
    scales = {symbol: (0, 0, power) for symbol, power in diagram.scales.items()}
    return {h: (1, 0, 0), size: (0, 1, 0), **scales} if scales else {h: (1, 0), size: (0, 1)}


#: Where a ratio of parameters is at least so large, exp(-ratio) counts as smaller than all powers.
VANISHES = 10


def _tied(law: ContactLaw, groups: Sequence[Sequence[Symbol]]) -> list[list[Symbol]]:
    """Join groups of parameters where an exponential holds a ratio of them by itself, as exp((s0 - h)/ell) does.

    Were s0 not of one order with ell, exp(s0/ell) would be infinite: it is a number, however large.
    """
    values = sample_values(law)
    place = {symbol: i for i, group in enumerate(groups) for symbol in group}
    for expr in (law.a, law.F_ela, law.zeta, law.F_adh):
        for function in sorted(expr.atoms(*EXPONENTIAL), key=str):
            for term in Add.make_args(function.args[0].expand()):
                powers = term.as_powers_dict()
                pair = [symbol for symbol in powers if symbol.is_Symbol]
                if not set(pair) <= place.keys() or len(pair) != 2 or powers[pair[0]] != -powers[pair[1]]:
                    continue
                one, other = sorted(place[symbol] for symbol in pair)
                value = term.subs(values)
                if one != other and abs(value) > 1 and (value > 0 or -value < VANISHES):
                    place = {symbol: one if i == other else i for symbol, i in place.items()}
    found: dict[int, list[Symbol]] = {}
    for symbol, i in place.items():
        found.setdefault(i, []).append(symbol)
    return list(found.values())


#: Powers of ten that eps has gone through where a sign is taken: it must be the same at all of them.
SIGN_DECADES = (60, 600, 6000)


def sign_within(law: ContactLaw, directions: Mapping[Symbol, Normal], cone: Cone, state: Expr) -> int | None:
    """Sign of a leading form in h and delta within a cone; None if it has none, as where a logarithm changes it.

    A logarithm has the sign that it has along an inner ray of the cone, not that of any numbers.

    Parameters
    ----------
    law : ContactLaw
    directions : mapping from Symbol to Normal
        Logarithm of each symbol, as a direction.
    cone : Cone
    state : Expr
        The form.
    """
    # most forms are products of what is positive, once the parameters that do not scale are numbers: of 50 digits, lest
    # a high power of one has a million
    fixed = {symbol: Float(value, 50) for symbol, value in sample_values(law).items() if symbol not in directions}
    simple = state.xreplace(fixed)
    if (simple.is_Mul or simple.is_Pow or simple.is_Symbol) and (simple.is_positive or simple.is_negative):
        return 1 if simple.is_positive else -1
    inner = [sum(parts) for parts in zip(*cone, strict=True)]
    arguments = sorted(state.free_symbols, key=str)
    function = lambdify(arguments, state, "mpmath", dummify=True)
    own = {symbol: mpmath.mpf(value.p) / value.q for symbol, value in sample_values(law).items()}
    alike = _within_orders(own, directions)
    signs = set()
    with mpmath.workdps(50):
        for decades in SIGN_DECADES:
            scaled = {
                s: alike.get(s, 1) * mpmath.mpf(10) ** (-decades * dot(along, inner)) for s, along in directions.items()
            }
            known = {**dict.fromkeys(COMMON_PARAMETERS, mpmath.mpf(1)), **own, **scaled}
            try:
                value = mpmath.mpmathify(function(*(known[symbol] for symbol in arguments)))
            except (ZeroDivisionError, ValueError, OverflowError):
                return None
            if not isinstance(value, mpmath.mpf) or not mpmath.isfinite(value) or value == 0:
                return None
            signs.add(1 if value > 0 else -1)
    return signs.pop() if len(signs) == 1 else None


def _within_orders(own: Mapping[Symbol, mpmath.mpf], directions: Mapping[Symbol, Normal]) -> dict[Symbol, mpmath.mpf]:
    """Size of each parameter that scales over the mean of those that scale alike: 2 sigma - Pi0 R has their sign."""
    groups: dict[Normal, list[Symbol]] = {}
    for symbol, along in directions.items():
        if symbol in own:
            groups.setdefault(along, []).append(symbol)
    found: dict[Symbol, mpmath.mpf] = {}
    for group in groups.values():
        mean = mpmath.exp(sum(mpmath.log(abs(own[symbol])) for symbol in group) / len(group))
        found |= {symbol: own[symbol] / mean for symbol in group}
    return found


def is_conservative(law: ContactLaw) -> bool | None:
    """Whether U_h = 0: the elastic force at given delta is the same at all gaps."""
    if is_rigid(law) or is_dry(law):
        return True
    known = {d.F_a: diff(law.F_ela, a), d.F_h: diff(law.F_ela, h), d.a_h: definitions(law)[d.a_h]}
    through_gap = d.generic_dynamics(law.general).by_gap.subs(known)
    if through_gap == 0:
        return True
    explicit = through_gap.subs(a, law.a)
    for gap, deflection in ((Rational(1, 100), Rational(1, 700)), (Rational(3), Rational(-2, 5))):
        value = explicit.subs({h: gap, delta: deflection})
        if value.subs({symbol: Rational(3, 5) for symbol in value.free_symbols}).evalf() != 0:
            return False
    return None


# ----------------------------------------------------------------------------------------------- one side of the plane


def _regimes(
    law: ContactLaw,
    side: Side,
    directions: Mapping[Symbol, Normal],
    effort: int,
    conservative: bool,
    other_side: Sequence[Regime],
) -> list[Regime]:
    """Cut one side of the plane into regimes; their conditions are still to be found."""
    axes = len(directions[h])
    start = orthants(axes, positive=(2,) if axes == 3 else ())

    def leading_terms(cone: Cone) -> tuple[tuple[str, Expr | str], ...]:
        found = contact_series(law, cone, directions, SIGN[side], effort=effort // SHARE, wanted=_wanted(law))
        return tuple(
            (name, str(series) if isinstance(series, UndecidedError) else _coefficient(series))
            for name, series in found.items()
        )

    with within(effort, OutOfEffortError):
        groups = merged([([cone], label) for cone, label in settle(start, leading_terms)])
    regimes = []
    with within(effort, OutOfEffortError):
        for cones, _ in groups:
            # corrections are those within the model, where the regime has a part there
            inner = simpler(cut(cones, [(0, 1, 0)[:axes]]))
            settled = settle(inner or cones, lambda cone: _with_corrections(law, cone, directions, side, effort))
            found = [(scale_of(cone, directions, CORRECTION_TERMS), series) for cone, series in settled]
            regimes.append((cones, bool(inner), found))
    with within(effort, OutOfEffortError):
        if not conservative:
            _integrate_along_delta([series for _, _, found in regimes for _, series in found], SIGN[side])
        made = [_regime(side, cones, inside, found) for cones, inside, found in regimes]
    if is_rigid(law):
        made = [_without_deflection(regime) for regime in made]
    return _named(law, sorted(made, key=_place), directions, other_side)


def _wanted(law: ContactLaw) -> tuple[str, ...]:
    """What is expanded; of a general law the slope of F_ela in h too, which U_h is made of."""
    return (*QUANTITIES, d.dF_dh.name) if law.general else QUANTITIES


def _with_corrections(
    law: ContactLaw, cone: Cone, directions: Mapping[Symbol, Normal], side: Side, effort: int
) -> dict[str, Series | UndecidedError]:
    """Series of all quantities, with the next terms if they do not take too many operations."""
    found = contact_series(
        law, cone, directions, SIGN[side], (CORRECTION_TERMS, KEPT), effort // SHARE, wanted=_wanted(law)
    )
    if any(isinstance(series, OutOfEffortError) for series in found.values()):
        # what was decided stays so, however much was spent on corrections
        with within(effort // SHARE, OutOfEffortError, apart=True):
            return contact_series(law, cone, directions, SIGN[side], wanted=_wanted(law))
    return found


def _without_deflection(regime: Regime) -> Regime:
    """Rigid particles: what stood for the deflection was the force, and no force is too large."""
    forms = {name: form for name, form in regime.forms.items() if name != "delta"}
    return replace(regime, inside=True, forms=forms, lambda1=None, edge=None)


def _place(regime: Regime) -> tuple[bool, bool, float]:
    """From large gaps to small ones; what lies outside the model, or is undecided, last."""
    p, s, *_ = _inner(regime.cones)
    return not regime.inside, not regime.forms, p / (abs(p) + abs(s))


def _coefficient(series: Series) -> Expr:
    return leading(series)[1] if series.terms or series.remainder else S.Zero


def _inner(cones: Sequence[Cone]) -> tuple[int, ...]:
    """A ray inside a region."""
    return primitive([sum(parts) for parts in zip(*cones[0], strict=True)])


def _integrate_along_delta(series: Sequence[dict[str, Series | UndecidedError]], side: int) -> None:
    """Add U_h, the integral of 2 dF_ela/dh over delta from 0, to leading order.

    It is dominated by its upper limit if delta dF_ela/dh grows with delta in every regime.
    """
    integrals: list[Series | UndecidedError] = []
    # under the paper's restriction the slope is F_a a_h
    names = (d.dF_dh.name,) if all(d.dF_dh.name in found for found in series) else (d.F_a.name, d.a_h.name)
    try:
        for found in series:
            terms = [leading(_decided(found[name]), name) for name in names]
            order = tuple(sum(powers) for powers in zip(*(powers for powers, _ in terms), strict=True))
            slope = Mul(*(term for _, term in terms))
            power = _steepness(slope)
            if not power > -1:
                raise UndecidedError("small deflections dominate it")
            integrals.append(Series({order: 2 * side * slope * size / (power + 1)}, frozenset()))
    except UndecidedError as reason:
        integrals = [UndecidedError(f"the integral over delta is not decided: {reason}")] * len(series)
    for found, integral in zip(series, integrals, strict=True):
        found["U_h"] = integral


@lru_cache(maxsize=10_000)
def _steepness(term: Expr) -> Expr:
    """Power of delta in a term.

    Raises
    ------
    UndecidedError
        If it is not a number.
    """
    base, power = term.as_independent(size, as_Add=False)[1].as_base_exp()
    if base == size or base == 1:
        return power if base == size else S.Zero
    power = simplify(size * diff(term, size) / term)
    if not power.is_number:
        raise UndecidedError(f"{term} is no power of delta")
    return power


def _regime(
    side: Side,
    cones: list[Cone],
    inside: bool,
    found: Sequence[tuple[Scale, dict[str, Series | UndecidedError]]],
) -> Regime:
    """Leading forms and corrections in a region; name and conditions are still to be found."""
    first = found[0][1]
    undecided = {name: str(first[name]) for name in FORMS if isinstance(first.get(name), UndecidedError)}
    nothing = Regime("", side, inside, (), {}, undecided, None, None, None, None, tuple(cones))
    try:
        balance = leading(_decided(first["F"]), "F")[1] * SIGN[side]
        deflection, power = _solved(balance)
        stretches = [(_stretch(_decided(series["F"]), power, scale), Powers()) for scale, series in found]
    except UndecidedError as reason:
        return replace(nothing, undecided={**undecided, "delta": str(reason)})
    forms = {"delta": Form(deflection, size, *_corrections([stretch for stretch, _ in stretches], deflection))}
    for name in FORMS:
        quantity = first.get(name)
        if not isinstance(quantity, Series) or not (quantity.terms or quantity.remainder):
            continue
        state = leading(quantity)[1]
        corrections: tuple[tuple[Expr, ...], bool] = ((), False)
        if name != "U_h":
            changes = [
                _at_given_force(_decided(series[name]), stretch, scale, S.Zero, powers)
                for (scale, series), (stretch, powers) in zip(found, stretches, strict=True)
            ]
            corrections = _corrections(changes, deflection)
        forms[name] = Form(_in_force(state, deflection), state, *corrections)
    reaches = inside and any(ray[1] < 0 for cone in cones for ray in cone)
    return replace(
        nothing,
        forms=forms,
        lambda1=_exponent(forms.get("delta")),
        lambda2=_exponent(forms.get("dh_dt")),
        balance=balance,
        edge=_tidy(balance.subs(size, R)) if reaches else None,
    )


def _stretch(balance: Series, power: Expr, scale: Scale) -> Series:
    """Deflection at given h and F over its leading form, from the series of F in h and delta, by iteration.

    In it, delta stands for the leading form of the deflection.
    """
    stretch = Series({zero(scale): S.One})
    # each round is right to one order more, and one correction of the second order may be the largest left
    for _ in range(3):
        stretch = raised(_at_given_force(balance, stretch, scale, -power, Powers()), -1 / power, "F", scale)
    return stretch


#: Powers of a stretch that are known: many terms, of all quantities, go as the same power of delta.
Powers = dict[Expr, Series]


def _at_given_force(quantity: Series, stretch: Series, scale: Scale, power: Expr, powers: Powers) -> Series:
    """Series of quantity/leading form * stretch**power, where delta becomes delta * stretch.

    Parameters
    ----------
    quantity, stretch : Series
    scale : Scale
    power : Expr
    powers : dict from Expr to Series
        Powers of the stretch; those that are found are added.
    """
    dominant, coefficient = leading(quantity)
    parts = [Series({}, frozenset(minus(r, dominant) for r in quantity.remainder))]
    for order, term in quantity.terms.items():
        relative = Series({minus(order, dominant): term / coefficient})
        steepness = _steepness(term) + power
        if steepness not in powers:
            one = Series({zero(scale): S.One})
            powers[steepness] = raised(stretch, steepness, "delta", scale) if steepness != 0 else one
        parts.append(multiplied(relative, powers[steepness], scale.kept))
    return added(parts)


def _decided(series: Series | UndecidedError) -> Series:
    if isinstance(series, UndecidedError):
        raise series
    return series


def _solved(balance: Expr) -> tuple[Expr, Expr]:
    """Solve F = balance for the size of delta; returns it and the power of delta in the balance."""
    rest, dependent = balance.as_independent(size, as_Add=False)
    if dependent == 1:
        raise UndecidedError(f"to leading order F does not depend on delta: it saturates at {balance}")
    base, power = dependent.as_base_exp()
    if base != size or not is_simple(power):
        raise UndecidedError(f"to leading order F is no simple power of delta: {balance}")
    return _tidy((force / rest) ** (1 / power)), power


def is_simple(power: Expr) -> bool:
    """Whether a root can be taken in exact numbers: one of a million has no end of digits."""
    return isinstance(power, Rational) and max(abs(power.p), power.q) <= MOST_OPERATIONS


@lru_cache(maxsize=10_000)
def _in_force(state: Expr, deflection: Expr) -> Expr:
    return _tidy(state.subs(size, deflection))


@lru_cache(maxsize=10_000)
def _tidy(form: Expr) -> Expr:
    """Collect powers, and join logarithms."""
    if form.has(log):
        return joined_logarithms(form)
    return powsimp(form) if form.is_Mul or form.is_Pow else form


def _corrections(changes: Sequence[Series], deflection: Expr) -> tuple[tuple[Expr, ...], bool]:
    """Largest terms besides 1 over the cones of a region, in h and F, and whether all of them are known."""
    largest: dict[Expr, None] = {}
    resolved = True
    for change in changes:
        known = {
            order: term for order, term in change.terms.items() if any(order) and not (term.is_Add and is_zero(term))
        }
        for order in minimal([*known, *change.remainder]):
            if order in known and order not in change.remainder:
                largest[_in_force(_short(known[order]), deflection)] = None
            else:
                resolved = False
    return tuple(largest), resolved


@lru_cache(maxsize=10_000)
def _short(term: Expr) -> Expr:
    """A coefficient that is a sum, in few words."""
    return simplify(term) if term.has(Add) and term.count_ops() <= MOST_OPERATIONS else term


def _exponent(form: Form | None) -> Expr | None:
    """Return dln(form)/dln(h) at constant force."""
    if form is None:
        return None
    powers = [factor.as_base_exp() for factor in Mul.make_args(form.leading) if factor.has(h)]
    if all(base == h and power.is_Rational for base, power in powers):
        return Add(*(power for _, power in powers))
    return simplify(h * diff(form.leading, h) / form.leading)


# -------------------------------------------------------------------------------------------------------------- names


def _named(
    law: ContactLaw, regimes: list[Regime], directions: Mapping[Symbol, Normal], other_side: Sequence[Regime]
) -> list[Regime]:
    """Name regimes after the claimed limits in them, or after the same region on the other side; or number them."""
    names: dict[int, str] = {}
    for limit in law.limits:
        holding = [i for i, regime in enumerate(regimes) if _holds(limit, regime, directions)]
        if len(holding) == 1:
            before = names.get(holding[0])
            names[holding[0]] = limit.name if before is None else f"{before} / {limit.name}"
    regions = {frozenset(hull_normals(regime.cones)): regime.name for regime in other_side}
    for i, regime in enumerate(regimes):
        same = regions.get(frozenset(hull_normals(regime.cones)))
        if i not in names and same is not None and same not in names.values():
            names[i] = same
    for inside in (True, False):
        unnamed = [i for i, regime in enumerate(regimes) if regime.inside == inside and i not in names]
        free = (str(n) for n in count(1) if str(n) not in names.values())
        for i in unnamed:
            names[i] = next(free) if inside else "outside" if len(unnamed) == 1 else f"outside {next(free)}"
    return [replace(regime, name=names[i]) for i, regime in enumerate(regimes)]


def _holds(limit: Limit, regime: Regime, directions: Mapping[Symbol, Normal]) -> bool:
    """Whether some of the scalings that a limit speaks of lie in a regime."""
    if side_of(limit) != SIGN[regime.side] or regime.balance is None:
        return False
    ordering = [
        tuple(x - y for x, y in zip(low, high, strict=True))
        for low, high in (
            (_exponents(small, regime, directions), _exponents(large, regime, directions))
            for small, large in inequalities(limit)
            if not (small / large).has(exp, log)  # which vanish, or count as one, beside powers
        )
    ]
    return all(any(normal) for normal in ordering) and bool(cut(regime.cones, ordering))


def _exponents(monomial: Expr, regime: Regime, directions: Mapping[Symbol, Normal]) -> Normal:
    """Exponent of a product of powers in a regime, as a linear form of the axes; up to a common factor 12."""
    total = [S.Zero] * len(directions[h])
    form = monomial.subs(delta, SIGN[regime.side] * size).subs(F, SIGN[regime.side] * force)
    for base, power in form.subs(force, regime.balance).expand().as_powers_dict().items():
        if base in directions:
            total = [x + power * y for x, y in zip(total, directions[base], strict=True)]
    return tuple(int(12 * x) for x in total)


# --------------------------------------------------------------------------------------------------------- crossovers


def _crossovers(law: ContactLaw, regimes: Sequence[Regime], directions: Mapping[Symbol, Normal]) -> Iterator[Crossover]:
    for one, other in combinations(regimes, 2):
        if not (one.forms and other.forms):
            continue
        for normal in shared_facets(one.cones, other.cones):
            facet = [ray for cone in one.cones for ray in cone if dot(normal, ray) == 0]
            on_it = primitive([sum(parts) for parts in zip(*facet, strict=True)])
            lines = {
                name: line
                for name in MEETING
                if (line := _meeting(law, name, one, other, directions, on_it)) is not None
            }
            if not lines:
                guess = _line_of(normal, directions)
                if guess is not None:
                    yield Crossover(one.name, other.name, one.side, "", guess, {}, normal)
                continue
            quantity, line = next(iter(lines.items()))
            elsewhere = {n: eq.rhs for n, eq in lines.items() if eq.lhs == line.lhs and eq.rhs != line.rhs}
            yield Crossover(one.name, other.name, one.side, quantity, line, elsewhere, normal)


@lru_cache(maxsize=10_000)
def _ratio(one: Expr, other: Expr) -> Expr:
    """Of two forms: many regimes have the same ones."""
    return powsimp(one / other)


def _meeting(
    law: ContactLaw, name: str, one: Regime, other: Regime, directions: Mapping[Symbol, Normal], on_facet: Ray
) -> Eq | None:
    """Where the leading forms of a quantity in two regimes have the same size, if that is on the facet given."""
    if name not in one.forms or name not in other.forms:
        return None
    ratio = _ratio(one.forms[name].leading, other.forms[name].leading)
    if not ratio.free_symbols or _order_at(ratio, one, on_facet, directions) != 0:
        return None
    for symbol in (force, h):
        if symbol in ratio.free_symbols:
            rest, dependent = ratio.as_independent(symbol, as_Add=False)
            base, power = dependent.as_base_exp()
            if base != symbol or not is_simple(power):
                return None
            sign = sign_within(law, directions, (on_facet,), rest)
            if sign is None:
                return None
            return Eq(symbol, _tidy((sign / rest) ** (1 / power)), evaluate=False)
    return None


def _order_at(form: Expr, regime: Regime, ray: tuple[int, ...], directions: Mapping[Symbol, Normal]) -> Rational | None:
    """Power of eps with which a form in h and F goes along one scaling of a regime."""
    direct = _powers_along(form, ray, directions)
    balance = None if regime.balance is None else _powers_along(regime.balance, ray, directions)
    if direct is not None and balance is not None:
        return direct[0] + direct[1] * balance[0]
    try:
        order, _ = leading(expand(form.subs(force, regime.balance), scale_of((ray,), directions, 1)))
    except UndecidedError:
        return None
    return order[0]


def _powers_along(form: Expr, ray: tuple[int, ...], directions: Mapping[Symbol, Normal]) -> tuple[Expr, Expr] | None:
    """Power of eps of a product of powers along a scaling, and its power of F; None if it is no such product."""
    order, by_force = S.Zero, S.Zero
    for factor in Mul.make_args(form):
        base, power = factor.as_base_exp()
        if base == force and power.is_Rational:
            by_force += power
        elif base in directions and power.is_Rational:
            order += power * dot(directions[base], ray)
        elif factor.free_symbols & {force, *directions}:
            return None
    return order, by_force


def _line_of(normal: Normal, directions: Mapping[Symbol, Normal]) -> Eq | None:
    """Where an argument of the law becomes of order one: h against R or a length of the law's own."""
    if normal[1] != 0:
        return None
    for symbol in (R, *directions):
        along = directions.get(symbol, (0,) * len(normal))
        difference = [x - y for x, y in zip(directions[h], along, strict=True)]
        if symbol not in (h, size) and primitive(difference) in (normal, tuple(-x for x in normal)):
            return Eq(h, symbol, evaluate=False)
    return None


def _conditions(
    law: ContactLaw,
    regime: Regime,
    regimes: Sequence[Regime],
    crossovers: Sequence[Crossover],
    directions: Mapping[Symbol, Normal],
) -> tuple[Condition, ...]:
    """Defining inequalities of a regime: on which side of each of its crossovers it lies.

    Where nothing is known to cross over, as against an undecided neighbour, the face between them is the border, up to
    a number of order one: whatever lies beyond it is not this regime's.
    """
    found: dict[Condition, None] = {}
    for crossover in crossovers:
        if regime.name not in (crossover.first, crossover.second):
            continue
        line = crossover.line
        order = _order_at(line.lhs / line.rhs, regime, _inner(regime.cones), directions)
        if order is None or order == 0:
            continue
        found[Condition(line.lhs, line.rhs) if order > 0 else Condition(line.rhs, line.lhs)] = None
    crossed = {(c.first, c.second) for c in crossovers} | {(c.second, c.first) for c in crossovers}
    borders = [
        normal
        for other in regimes
        if other is not regime and (regime.name, other.name) not in crossed
        for normal in shared_facets(regime.cones, other.cones)
    ]
    for normal in borders:
        border = _border(law, normal, regime, directions)
        if border is not None:
            found[border] = None
    return tuple(found)


def _border(law: ContactLaw, normal: Normal, regime: Regime, directions: Mapping[Symbol, Normal]) -> Condition | None:
    """On which side of a face a regime lies, up to a number of order one: in h and F; in h and delta, if undecided."""
    # along the face h^p delta^s eps^q = 1, over R; a parameter over its unit stands for eps
    rest, p, s = S.One, normal[0], normal[1]
    if len(normal) > 2 and normal[2]:
        scaled, power = _parameter_scale(law, directions)
        rest = scaled ** Rational(normal[2], power)
    line = _line_of(normal, directions)
    if line is None and s == 0 and p == 0:
        return None
    if line is not None or s == 0:
        gap = line.rhs if line is not None else _tidy(R * rest ** Rational(-1, p))
        return Condition(h, gap) if p > 0 else Condition(gap, h)
    deflection = _tidy(R * (rest * (h / R) ** p) ** Rational(-1, s))
    if regime.balance is None:
        return Condition(size, deflection) if s > 0 else Condition(deflection, size)
    load = _tidy(regime.balance.subs(size, deflection))
    if not regime.balance.has(size):
        return None
    # the force grows with the deflection
    return Condition(force, load) if s > 0 else Condition(load, force)


def _parameter_scale(law: ContactLaw, directions: Mapping[Symbol, Normal]) -> tuple[Expr, int]:
    """A parameter that scales, over its unit, and the power of eps that it scales with."""
    symbol = min((s for s in directions if s not in (h, size)), key=lambda s: (abs(directions[s][2]), s.name))
    x, y, z = (Rational(p.numerator, p.denominator) for p in powers_of_units(law.parameters[symbol]))
    modulus = E if E in parameters_of(law) else force_unit(law) / R**2
    return symbol / (R**x * modulus**y * eta**z), directions[symbol][2]


def _points(regimes: Sequence[Regime], crossovers: Sequence[Crossover]) -> list[Meeting]:
    """Points where three or more regimes meet: edges of the cones, seen in the plane."""
    facets = {regime.name: hull_normals(regime.cones) for regime in regimes if regime.forms}
    axes = len(regimes[0].cones[0])
    if axes == 2:
        rays: list[tuple[int, ...]] = [(0, 0)]
    else:
        rays = sorted({ray for regime in regimes for cone in regime.cones for ray in cone if ray[2] > 0})
    found = []
    for ray in rays:
        names = [name for name, normals in facets.items() if all(dot(normal, ray) >= 0 for normal in normals)]
        lines = [c.line for c in crossovers if c.first in names and c.second in names]
        at = next((point for one, other in combinations(lines, 2) if (point := _intersection(one, other))), None)
        if len(names) >= 3 and at is not None:
            found.append(Meeting(tuple(names), regimes[0].side, *at))
    return found


def _intersection(one: Eq, other: Eq) -> tuple[Expr, Expr] | None:
    """Where two lines cross: h and F."""
    if one.lhs == h and other.lhs == h:
        return None
    if one.lhs == h or other.lhs == h:
        upright, slanted = (one, other) if one.lhs == h else (other, one)
        return upright.rhs, _tidy(slanted.rhs.subs(h, upright.rhs))
    rest, dependent = powsimp(one.rhs / other.rhs).as_independent(h, as_Add=False)
    base, power = dependent.as_base_exp()
    if base != h or not is_simple(power):
        return None
    gap = _tidy((1 / rest) ** (1 / power))
    return gap, _tidy(one.rhs.subs(h, gap))
