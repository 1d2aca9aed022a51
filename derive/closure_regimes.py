"""The asymptotic regimes of a closure in the plane of Re and volume fraction, discovered from its expression.

Input: a closure. Output: its regimes, each with the leading form of what it gives, exact in the volume fraction; the
crossovers, on which two leading forms are equal; and what the forms become at both ends, dilute and dense.

A closure by cases is taken case by case: a case is the expression that applies, and where it does. In each, the
expression is expanded as Re vanishes, and as it grows, at any fixed volume fraction (:mod:`softdyn.derive.scalings`).
Where a case ends before Re is that small or large, what is found is kept only if its crossover lies in the case: then
it is a regime between the two. At the ends the fraction varies too, together with Re, at whatever rates: the form there
is proved, disproved or undecided on that whole set, as a claim of the closure's author is. A closure's own parameters
are fixed, at any values.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count

from sympy import (
    Add,
    And,
    Dummy,
    Eq,
    Expr,
    Mul,
    Not,
    Piecewise,
    Pow,
    Rational,
    S,
    Symbol,
    expand_mul,
    log,
    piecewise_fold,
    powsimp,
    simplify,
    true,
)
from sympy.logic.boolalg import Boolean

from softdyn.derive.asymptotics import (
    OutOfEffortError,
    Series,
    UndecidedError,
    expand,
    is_small,
    is_zero,
    leading,
    minimal,
    relative,
)
from softdyn.derive.closure import (
    Closure,
    Re,
    c,
    densest,
    dimensions_for,
    eta,
    in_fractions,
    phi,
    r,
    ranges_of,
    sample_values,
)
from softdyn.derive.closure_limits import NO_SCALING, Jump, Ordered, jumps_of, known_of, ordered, verdict_on
from softdyn.derive.forms import joined_logarithms
from softdyn.derive.limits import EFFORT, MORE_TERMS, Verdict, with_more_terms
from softdyn.derive.patience import within
from softdyn.derive.positive import knowing_ranges
from softdyn.derive.regimes import Condition, Form
from softdyn.derive.scalings import Part, SeveralLogarithmsError, pieces_of, settled, whole
from softdyn.words import in_columns

#: Fractions of the fluid, of those that there are, and numbers that Re is set to, to see where a case applies.
LOOKED_AT = tuple(Rational(k, 100) for k in (1, 5, 15, 25, 35, 45, 55, 65, 75, 85, 95, 99))
FAR = Rational(10) ** 40
#: How far beyond a crossover a case must go on, for a regime to lie there.
BEYOND = 2
#: The ends of the plane.
ENDS = ("dilute", "dense")
#: What a regime is called that no claimed limit names.
NAMES = {1: "viscous", -1: "inertial", 0: "everywhere"}
BETWEEN = "between"


@dataclass(frozen=True)
class Case:
    """One case of a closure: an expression in Re and c, and where it applies."""

    condition: Boolean
    expression: Expr


@dataclass(frozen=True)
class End:
    """What a regime's form becomes at one end of the volume fractions.

    Attributes
    ----------
    name : str
        That of the claimed limit there; else "dilute" or "dense".
    small : Expr
        What is much less than 1 there: phi, c, or a difference such as phi_max - phi.
    form : Form or None
        Leading form and corrections there; None if it could not be decided.
    verdict : "proved", "disproved" or "undecided"
        Whether what the closure gives tends to that form as ``small`` vanishes and the regime's conditions sharpen, at
        whatever rates.
    reason : str
        Of what is not proved.
    """

    name: str
    small: Expr
    form: Form | None
    verdict: Verdict
    reason: str


@dataclass(frozen=True)
class ClosureRegime:
    """A region of the plane of Re and volume fraction with one leading form.

    Attributes
    ----------
    name : str
        That of the claimed limit that lies in it; else what :data:`NAMES` has, numbered where there are several.
    towards : int
        1 where Re is small, -1 where it is large, 0 if the form holds for any.
    case : Boolean
        Where the case applies that it is a regime of.
    conditions : tuple of Condition
    form : Form or None
        In Re, c, phi and the parameters; None if it could not be decided.
    exact : bool
        Whether the form is all that the closure has there, and not its leading term.
    ends : mapping from str to End
        Of those of :data:`ENDS` that the case reaches.
    undecided : str
        Why there is no form.
    between : bool
        Whether its case has Re between two numbers, so that it is neither small nor large.
    """

    name: str
    towards: int
    case: Boolean
    conditions: tuple[Condition, ...]
    form: Form | None
    exact: bool
    ends: Mapping[str, End]
    undecided: str
    between: bool = False


@dataclass(frozen=True)
class ClosureCrossover:
    """Where two regimes meet: Re = ... in c and phi. None, if it is no power of Re that their forms differ by."""

    first: str
    second: str
    case: Boolean
    line: Eq | None


@dataclass(frozen=True)
class ClosureDiagram:
    """The regimes of a closure, and what lies between them.

    Attributes
    ----------
    closure : Closure
    regimes : tuple of ClosureRegime
    crossovers : tuple of ClosureCrossover
    jumps : tuple of Jump
    densest : Expr
        The largest volume fraction of the grains: 1, or a parameter.
    """

    closure: Closure
    regimes: tuple[ClosureRegime, ...]
    crossovers: tuple[ClosureCrossover, ...]
    jumps: tuple[Jump, ...]
    densest: Expr

    def __str__(self) -> str:
        """One line for each regime: where it is, and its leading form."""
        given = self.closure.gives
        rows = [
            (
                one.name,
                ", ".join(map(str, one.conditions)),
                f"{given} = {one.form.leading}" if one.form else one.undecided,
            )
            for one in self.regimes
        ]
        return in_columns(rows)

    def regime(self, name: str) -> ClosureRegime:
        """Return a regime by its name."""
        return next(regime for regime in self.regimes if regime.name == name)


def discover_closure(closure: Closure, effort: int = EFFORT) -> ClosureDiagram:
    """Find the regimes of a closure, the crossovers between them, and what they become at the ends.

    Parameters
    ----------
    closure : Closure
    effort : int
        Operations after which what is not yet decided is left undecided.
    """
    found: list[ClosureRegime] = []
    crossovers: list[ClosureCrossover] = []
    for case in cases_of(closure):
        with within(effort, OutOfEffortError), knowing_ranges(ranges_of(closure)):
            regimes, lines = _of_case(closure, case)
            regimes = [replace(regime, ends=_ends_of(closure, case, regime)) for regime in regimes]
        for one, other, line in lines:
            names = (str(len(found) + one), str(len(found) + other))
            crossovers.append(ClosureCrossover(*names, case.condition, line))
        found += regimes
    named = _named(closure, found)
    crossovers = [replace(x, first=named[int(x.first)].name, second=named[int(x.second)].name) for x in crossovers]
    return ClosureDiagram(closure, tuple(named), tuple(crossovers), tuple(jumps_of(closure)), densest(closure))


# -------------------------------------------------------------------------------------------------------------- cases


def cases_of(closure: Closure) -> list[Case]:
    """Return the cases of a closure, each where no earlier one applies; those that apply nowhere are left out."""
    folded = piecewise_fold(in_fractions(closure, closure.expression))
    branches = folded.args if isinstance(folded, Piecewise) else ((folded, true),)
    cases = []
    before: list[Boolean] = []
    for expression, condition in branches:
        case = Case(And(condition, *(Not(earlier) for earlier in before)), expression)
        before.append(condition)
        if any(applies(closure, case.condition, value, fraction) for value in _SPREAD for fraction in LOOKED_AT):
            cases.append(case)
    return cases


#: Numbers that Re is set to, to see whether a case applies anywhere.
_SPREAD = (1 / FAR, *(Rational(10) ** Rational(k, 4) for k in range(-16, 29)), FAR)


def applies(closure: Closure, condition: Boolean, number: Expr, fraction: Expr) -> bool:
    """Whether a case applies at a value of Re, and of c; the parameters being typical.

    Parameters
    ----------
    closure : Closure
    condition : Boolean
    number, fraction : Expr
        Values of Re and of c.
    """
    at = {Re: number, c: fraction}
    values = {symbol: at.get(symbol, value) for symbol, value in sample_values(closure).items()}
    return bool(condition.subs(values) == true)


def points_on(closure: Closure, order: Ordered, path: Mapping[Symbol, Rational]) -> Iterator[tuple[Expr, Expr]]:
    """Re and c far along a path into an ordering, at several values of a fraction that is fixed.

    Parameters
    ----------
    closure : Closure
    order : Ordered
    path : mapping from Symbol to Rational
        Powers with which symbols vanish.
    """
    far = {symbol: FAR**-power for symbol, power in path.items()}
    number = far.get(Re, S.One)
    if order.replaced:
        yield from ((number, 1 - gone.xreplace(far).subs(sample_values(closure))) for gone in order.replaced.values())
    elif phi in far or c in far:
        yield number, far[c] if c in far else 1 - far[phi]
    else:
        yield from ((number, fraction) for fraction in LOOKED_AT)


def _reaches(closure: Closure, condition: Boolean, end: str) -> bool:
    """Whether a case applies at one end of the volume fractions, somewhere."""
    limit = densest(closure).subs(sample_values(closure))
    fraction = 1 - limit * Rational(1, 10**9) if end == "dilute" else 1 - limit * (1 - Rational(1, 10**9))
    return any(applies(closure, condition, value, fraction) for value in _SPREAD)


# ------------------------------------------------------------------------------------------------------------ regimes


#: Regimes of one case, and for each pair that meets its places among these, and the line.
OfCase = tuple[list[ClosureRegime], list[tuple[int, int, Eq | None]]]


def _of_case(closure: Closure, case: Case) -> OfCase:
    """Regimes of one case, from small to large Re, and the lines between them."""
    expr = case.expression
    nothing = ClosureRegime("", 0, case.condition, (), None, False, {}, "")
    whole_case = replace(nothing, form=Form(in_words(expr), expr), exact=True)
    if not expr.has(Re):
        return [whole_case], []
    reached = {
        side: any(applies(closure, case.condition, FAR**-side, fraction) for fraction in LOOKED_AT) for side in (1, -1)
    }
    if not any(reached.values()):
        return [replace(whole_case, between=True)], []  # Re is of order one throughout
    forms: dict[int, Form | str] = {}
    for side in (1, -1):
        try:
            forms[side] = _leading_form(closure, expr, Re, side)
        except UndecidedError as reason:
            forms[side] = str(reason)
    low, high = forms[1], forms[-1]
    if isinstance(low, Form) and isinstance(high, Form):
        if _same(low.state, high.state):
            exact = _same(expr, low.state)
            corrections = tuple(dict.fromkeys((*low.corrections, *high.corrections)))
            form = replace(low, corrections=corrections, resolved=low.resolved and high.resolved)
            towards = 0 if all(reached.values()) else 1 if reached[1] else -1
            return [replace(nothing, towards=towards, form=form, exact=exact)], []
        line = _line(low.state / high.state)
    else:
        line = None
    kept = [side for side in (1, -1) if reached[side] or (line is not None and _lies_in(closure, case, line, side))]
    if line is not None and len(kept) == 2 and isinstance(low, Form) and isinstance(high, Form):
        middle = _between(closure, expr)
        if middle:
            return _in_a_row(nothing, [low, *middle, high])
    found = []
    for side in kept:
        form_ = forms[side]
        conditions = _sides(line.rhs, side) if line is not None and len(kept) == 2 else ()
        if line is None and len(kept) == 2:
            conditions = _sides(S.One, side)
        found.append(
            replace(
                nothing,
                towards=side,
                conditions=conditions,
                form=form_ if isinstance(form_, Form) else None,
                exact=isinstance(form_, Form) and _same(expr, form_.state),
                undecided="" if isinstance(form_, Form) else form_,
            )
        )
    return found, [(0, 1, line)] if len(found) == 2 else []


#: By how much the lines beside a regime between two others must differ somewhere, for it to be one.
WIDE = 100


def _between(closure: Closure, expr: Expr) -> list[Form]:
    """Forms that hold between those at small and at large Re: terms of a sum of powers of Re that are the largest."""
    powers: dict[Expr, Expr] = {}
    for term in Add.make_args(expand_mul(expr)):
        rest, dependent = powsimp(term).as_independent(Re, as_Add=False)
        base, power = dependent.as_base_exp() if dependent != 1 else (Re, S.Zero)
        if base != Re or not power.is_Rational:
            return []
        powers[power] = powers.get(power, S.Zero) + rest
    values, ordered_powers = sample_values(closure), sorted(powers)
    found = []
    for power in ordered_powers[1:-1]:
        for fraction in LOOKED_AT:
            at = {**values, c: fraction, phi: 1 - fraction}
            sizes = {p: rest.subs(at) for p, rest in powers.items()}
            if not all(size.is_positive for size in sizes.values()):
                return []
            # where this term equals another one
            lines = {p: float(sizes[p] / sizes[power]) ** (1 / float(power - p)) for p in powers if p != power}
            low = max(line for p, line in lines.items() if p < power)
            high = min(line for p, line in lines.items() if p > power)
            if high > WIDE * low:
                form = powers[power] * Re**power
                others = tuple(in_words(_short(rest * Re**p / form)) for p, rest in powers.items() if p != power)
                found.append(Form(in_words(form), form, others))
                break
    return found


def _in_a_row(nothing: ClosureRegime, forms: Sequence[Form]) -> OfCase:
    """Regimes of forms in the order of their powers of Re: each where it is larger than any other."""
    lines = {(i, j): _line(forms[i].state / forms[j].state) for j in range(len(forms)) for i in range(j)}
    regimes = []
    for i, form in enumerate(forms):
        beyond = [_sides(line.rhs, 1 if i == one else -1)[0] for (one, other), line in lines.items()
                  if line is not None and i in (one, other)]  # fmt: skip
        towards = 1 if i == 0 else -1 if i == len(forms) - 1 else 0
        regimes.append(replace(nothing, towards=towards, conditions=tuple(beyond), form=form, between=not towards))
    return regimes, [(i, j, line) for (i, j), line in lines.items() if j == i + 1 or _meets(forms, line, i)]


def _meets(forms: Sequence[Form], line: Eq | None, one: int) -> bool:
    """Whether two forms that are equal on a line are the largest ones there, no denser than spheres can be."""
    for fraction in () if line is None else (x for x in LOOKED_AT if x >= Rational(1, 4)):
        assert line is not None
        at = {c: fraction, phi: 1 - fraction}
        number = line.rhs.subs(at).evalf()
        values = [form.state.subs({**at, Re: number, eta: 1, r: 1}).evalf() for form in forms]
        if number.is_number and all(v.is_number and v <= values[one] * (1 + Rational(1, 10**9)) for v in values):
            return True
    return False


def _sides(line: Expr, side: int) -> tuple[Condition, ...]:
    return (Condition(Re, line) if side > 0 else Condition(line, Re),)


def _lies_in(closure: Closure, case: Case, line: Eq, side: int) -> bool:
    """Whether a regime that a case does not reach the end of lies in it, beyond its crossover."""
    values = sample_values(closure)
    for fraction in LOOKED_AT:
        at = line.rhs.subs({**values, c: fraction, phi: 1 - fraction})
        if all(applies(closure, case.condition, at * BEYOND ** (-side * k), fraction) for k in (0, 1)):
            return True
    return False


def _line(ratio: Expr) -> Eq | None:
    """Re where a ratio of two forms is 1, if Re comes in as one power."""
    rest, dependent = powsimp(ratio).as_independent(Re, as_Add=False)
    base, power = dependent.as_base_exp()
    if base != Re or not power.is_Rational:
        return None
    number, others = (1 / rest).as_coeff_Mul()
    root = in_words(others ** (1 / power))
    # a number to a power of many digits is kept as it is
    return Eq(Re, root if number == 1 else _times(Pow(number, 1 / power, evaluate=False), root), evaluate=False)


def _times(number: Expr, root: Expr) -> Expr:
    exact = number.exp.is_integer or number.exp.q == 2
    return number.doit() * root if exact else Mul(number, root, evaluate=False) if root != 1 else number


def _leading_form(closure: Closure, expr: Expr, symbol: Symbol, side: int) -> Form:
    """Leading form of an expression, and its corrections, as a symbol vanishes (side 1) or grows (-1).

    Raises
    ------
    UndecidedError
    """
    units = {**dimensions_for(closure), symbol: dimensions_for(closure).get(symbol, dimensions_for(closure)[phi])}

    def find(part: Part) -> tuple[Expr, tuple[Expr, ...], bool]:
        series = with_more_terms(lambda kept: _known(expand(expr, part.scale(kept))), MORE_TERMS)
        rest = relative(series)
        orders = minimal([*rest.terms, *rest.remainder])
        known = [
            joined_logarithms(_short(part.axes.written(rest.terms[order]))) for order in orders if order in rest.terms
        ]
        return part.axes.written(leading(series)[1]), tuple(known), not (set(orders) & set(rest.remainder))

    def found(decomposed: bool) -> list[tuple[Expr, tuple[Expr, ...], bool]]:
        start = whole({symbol: (1,)}, decomposed)
        pieces = [part for part in pieces_of(start, (1,), units) if part.ratios == (symbol**side,)]
        return [form for _, form in settled(pieces, find, units)]

    try:
        forms = found(decomposed=False)
    except SeveralLogarithmsError:
        forms = found(decomposed=True)
    first, corrections, resolved = forms[0]
    if not all(_same(form, first) for form, _, _ in forms[1:]):
        raise UndecidedError(f"its leading form depends on how fast {symbol} changes")
    return Form(in_words(first), first, tuple(in_words(x) for x in corrections), resolved)


def _same(one: Expr, other: Expr) -> bool:
    """Whether two expressions are equal, as far as that can be shown."""
    try:
        return is_zero(one - other)
    except UndecidedError:
        return False


def _known(series: Series) -> Series:
    leading(series)
    return series


def _short(term: Expr) -> Expr:
    return simplify(term) if is_small(term) and not term.has(log) else term


def in_words(expr: Expr) -> Expr:
    """An expression in c and phi: sums in phi, where c comes in alone; powers of c as they are."""

    def in_phi(node: Expr) -> Expr:
        linear = [term for term in node.args if (term / c).is_number]
        if not linear or not any(term.is_number or term.has(phi) for term in node.args):
            return node
        return node + sum((term / c * (1 - phi) - term for term in linear), start=S.Zero)

    return expr.replace(lambda node: isinstance(node, Add), in_phi)


# --------------------------------------------------------------------------------------------------------------- ends


def end_of(closure: Closure, end: str) -> tuple[Symbol, Expr, dict[Symbol, Expr]]:
    """What vanishes at an end: a symbol, what it stands for, and c in it."""
    if end == "dilute":
        return phi, phi, {c: 1 - phi}
    limit = densest(closure)
    if limit == 1:
        return c, c, {}
    gap = Dummy("gap", positive=True)
    return gap, limit - phi, {c: 1 - limit + gap}


def _ends_of(closure: Closure, case: Case, regime: ClosureRegime) -> dict[str, End]:
    """What a regime's form becomes at the ends that its case reaches."""
    form = regime.form
    if form is None or not form.state.has(c):
        return {}
    found = {}
    for end in ENDS:
        if not _reaches(closure, case.condition, end):
            continue
        symbol, small, fraction = end_of(closure, end)
        written = {symbol: small}
        try:
            there = _leading_form(closure, form.state.xreplace(fraction), symbol, 1)
        except UndecidedError as reason:
            found[end] = End(end, small, None, "undecided", str(reason))
            continue
        verdict, reason_ = _uniform(closure, case, regime, (symbol, small, fraction), there)
        if reason_ == NO_SCALING:
            continue  # it does not go on to that end
        shown = Form(
            there.state.xreplace(written),
            there.state.xreplace(written),
            tuple(term.xreplace(written) for term in there.corrections),
            there.resolved,
        )
        found[end] = End(end, small, shown, verdict, reason_)
    return found


def _uniform(
    closure: Closure, case: Case, regime: ClosureRegime, at: tuple[Symbol, Expr, Mapping[Symbol, Expr]], there: Form
) -> tuple[Verdict, str]:
    """Whether a form holds at an end as the regime's conditions sharpen too, at whatever rates."""
    symbol, small, fraction = at
    pairs = [(symbol, S.One)]
    try:
        for condition in regime.conditions:
            sides = (
                in_fractions(closure, side).xreplace(dict(fraction)) for side in (condition.small, condition.large)
            )
            # a line is as large as its leading term there
            low, high = (side if side == Re else _leading_form(closure, side, symbol, 1).state for side in sides)
            pairs.append((low, high))
    except UndecidedError as reason:
        return "undecided", str(reason)
    order = Ordered(tuple(pairs), {} if symbol == small else {symbol: small}, {}, symbol)
    both = (case.expression.xreplace(dict(fraction)), there.state)
    piece, _ = verdict_on(known_of(closure), order, closure.gives, both)
    return piece.verdict, "" if piece.verdict == "proved" else piece.reason


# -------------------------------------------------------------------------------------------------------------- names


def _named(closure: Closure, regimes: Sequence[ClosureRegime]) -> list[ClosureRegime]:
    """Name regimes, and their ends, after the claimed limits in them; else by what they are."""
    names: dict[int, str] = {}
    ends: dict[tuple[int, str], str] = {}
    for limit in closure.limits:
        towards, end = _where(closure, limit)
        at = [
            i
            for i, regime in enumerate(regimes)
            if regime.towards in (towards, 0) and (not end or end in regime.ends) and not (towards and regime.between)
            if towards != 0 or regime.towards == 0
        ]
        at = [i for i in at if not towards or _reached(closure, regimes[i], towards)]
        if len(at) != 1:
            continue
        if not end:
            names.setdefault(at[0], limit.name)
        else:
            ends.setdefault((at[0], end), limit.name)
    for (i, _), name in ends.items():
        if i not in names and sum(regime.towards == regimes[i].towards for regime in regimes) > 1:
            names[i] = name
    often = Counter(_default_name(regime) for i, regime in enumerate(regimes) if i not in names)
    numbers = {name: count(1) for name in often}
    taken: set[str] = set()
    found = []
    for i, regime in enumerate(regimes):
        name = names.get(i, _default_name(regime))
        if i not in names and (often[name] > 1 or name in taken):
            name = f"{name} {next(numbers[name])}"
        taken.add(name)
        called = {end: replace(one, name=ends.get((i, end), end)) for end, one in regime.ends.items()}
        found.append(replace(regime, name=name, ends=called))
    return found


def _default_name(regime: ClosureRegime) -> str:
    return BETWEEN if regime.between else NAMES[regime.towards]


def _reached(closure: Closure, regime: ClosureRegime, towards: int) -> bool:
    return any(applies(closure, regime.case, FAR**-towards, fraction) for fraction in LOOKED_AT)


def _where(closure: Closure, limit: object) -> tuple[int, str]:
    """Towards which Re a claimed limit goes, and to which end."""
    order = ordered(limit)  # type: ignore[arg-type]
    towards, end = 0, ""
    for small, large in order.pairs:
        ratio = small / large
        if ratio == Re:
            towards = 1
        elif ratio == 1 / Re:
            towards = -1
        elif ratio == phi:
            end = "dilute"
        elif ratio == c or order.written.get(ratio, S.Zero) == densest(closure) - phi:
            end = "dense"
    return towards, end
