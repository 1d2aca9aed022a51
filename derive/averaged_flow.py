"""The flow of a fluid among grains, averaged over these, as a weak form: declared.

With c the share of the fluid in the volume and phi = 1 - c that of the grains, u = c v and us = phi v^s are the fluxes
of the two, v and v^s their velocities, and

    div(u + us) = 0
    rho (du/dt + div(u u/c)) = -c grad p + div(2 eta* D(u + us)) + phi/V K (v^s - v) + c f .

eta* is the viscosity of the mixture, K (v^s - v) the drag on the fluid of each grain, of volume V, f a force per volume
of fluid: rho g and what else there is. The pressure is shared: grains feel -V grad p (Anderson & Jackson, 1967;
Jackson, The Dynamics of Fluidized Particles, 2000). D is that of the mixture, for it is sheared as a whole. Without
grains, c = 1, these are the equations of Navier and Stokes.

In the weak form all of the flux of momentum is integrated by parts, so that the residual of a node at a boundary is the
force on the fluid there, and the momentum that it carries in; residuals add up to the balance of momentum exactly.
Where fluid leaves, :func:`outlet` is integrated over the facets.

Grains that move by themselves are known by what they do over a time step. Their share of the volume grows by dc/dt,
which div u then makes up for, so that over each step no volume is lost. The force on them, drag that is implicit in
their velocities at the end of the step, is friction (u - tried) - pull + lent grad p: what they gain by the pressure in
a step in which drag stops them, the fluid gives. A grain feels a mean over its surroundings, which is no matter of one
place: pull has it, of the flow that is tried, and where what comes out is that flow, the first term is nothing.

Elements: velocity of order 2 and pressure of order 1 (Taylor & Hood, 1973), or both of order 1. Those of the first kind
conserve volume around each corner alone: through a bed whose porosity changes within few elements the flux swings. So
where there is drag, 4 h^2 k div(u + us) resists a loss of volume (grad-div stabilisation, arXiv:1712.00413); it falls
with h faster than the error does, h being that of an equilateral triangle.

Those of the second kind alone are unstable. The residual of the momentum balance, R, in which second derivatives
vanish, is tested by the gradient of the pressure's test function, and along the flow (Brooks & Hughes, 1982; Hughes,
Franca & Balestra, Comput. Methods Appl. Mech. Eng. 59 (1986) 85):

    integral of tau (rho v . grad of the test velocity + grad of the test pressure) . R
    1/tau^2 = (rho rate)^2 + 2 rho^2 v . G v + (3 eta* tr G + k)^2 ,     G = sum of grad lambda_i grad lambda_i ,

with lambda_i the linear shape functions, tr G = 4/h^2 of an equilateral triangle of side h, and k u = phi/V K u/c the
drag of grains at rest. With the 3, flows with known solutions reach the order of linear elements; with 1 they do not
(tests/test_flow_orders.py). Drag is part of tau: without, a bed loses mass, for tau then exceeds what the drag lets the
flow do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from sympy import Abs, Expr, Limit, Matrix, Piecewise, Rational, S, Symbol, limit, pi, sqrt

from softdyn.derive import closure as arguments
from softdyn.derive.closure import Closure
from softdyn.derive.dimensions import (
    DIMENSIONLESS,
    FORCE,
    LENGTH,
    MASS,
    PRESSURE,
    TIME,
    VISCOSITY,
    Dimension,
    DimensionMismatchError,
    dimension_of,
)
from softdyn.derive.symbols import eta
from softdyn.derive.weak_form import FINENESS, NAME, Field, WeakForm, divergence, dot, metric, normal, symmetric
from softdyn.errors import LawError

rho, r = arguments.rho, arguments.r
#: du/dt is rate u + past.
rate = Symbol("rate", nonnegative=True)

#: Dimensions of everything that the form has without closures and terms.
UNITS: dict[str, Dimension] = {
    "u": LENGTH / TIME,
    "us": LENGTH / TIME,
    "p": PRESSURE,
    "c": DIMENSIONLESS,
    "force": FORCE / LENGTH**3,
    "past": LENGTH / TIME**2,
    "pressure": PRESSURE,
    "rho": MASS / LENGTH**3,
    "eta": VISCOSITY,
    "r": LENGTH,
    "rate": TIME**-1,
    "growth": TIME**-1,
    "friction": FORCE / LENGTH**3 / (LENGTH / TIME),
    "tried": LENGTH / TIME,
    "pull": FORCE / LENGTH**3,
    "lent": DIMENSIONLESS,
    # of sizes that a number without a dimension is added to
    "speed": LENGTH / TIME,
    "slip": LENGTH / TIME,
}
#: Added to Re in squares, so that powers and logarithms of it, and their slopes, are finite where the slip is zero. No
#: closure feels it: its square root is 1e-20.
LEAST_RE = Rational(1, 10**40)
#: Added to phi in squares where it divides: 1 - c is known to a rounding of 1.
LEAST_PHI = Rational(1, 2**52)
#: Added to squares of speeds: it is lost in the square of any speed above 1e-142, whatever the units.
LEAST_SQUARE = Rational(1, 10**300)


@dataclass(frozen=True)
class Flow:
    """What the force of a term may depend on: vectors are matrices of one column.

    Attributes
    ----------
    dimension : 2 or 3
    u, us : Matrix
        Fluxes of the fluid and of the grains.
    gradient : Matrix
        Of u, a row for each component.
    p, c, phi, rho, eta : Expr
        Pressure, volume fractions, density and viscosity of the fluid.
    speed : Expr
        Size of u; its slope is finite at u = 0.
    own : mapping from str to Expr or Matrix
        Coefficients that the term declares.
    """

    dimension: int
    u: Any
    us: Any
    gradient: Any
    p: Expr
    c: Expr
    phi: Expr
    rho: Expr
    eta: Expr
    speed: Expr
    own: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Term:
    """A force on the fluid that a user adds to the momentum balance.

    Parameters
    ----------
    name : str
        A lower-case identifier.
    force : function
        Of a :class:`Flow`: the force per volume, a matrix of one column.
    parameters : mapping from Symbol to Dimension
        Numbers of its own.
    coefficients, vectors : mapping from str to Dimension
        Fields of its own that are given at nodes, scalars and vectors: ``flow.own["temperature"]``.
    source, description : str

    Raises
    ------
    LawError
        Listing every fault: a force that is none, unknown symbols, a wrong dimension.
    """

    name: str
    force: Callable[[Flow], Any]
    parameters: Mapping[Symbol, Dimension] = field(default_factory=dict)
    coefficients: Mapping[str, Dimension] = field(default_factory=dict)
    vectors: Mapping[str, Dimension] = field(default_factory=dict)
    source: str = ""
    description: str = ""

    def __post_init__(self) -> None:
        faults = _term_faults(self)
        if faults:
            raise LawError(str(self.name), tuple(faults), "term")


def fields_of(term: Term, dimension: int, order: int) -> tuple[Field, ...]:
    """Coefficients that a term declares.

    Parameters
    ----------
    term : Term
    dimension : int
        2 or 3.
    order : int
        Of the fields: 1, linear, or 2.
    """
    scalars = tuple(Field(name, dimension, order=order) for name in term.coefficients)
    return scalars + tuple(Field(name, dimension, vector=True, order=order) for name in term.vectors)


def _term_faults(term: Term) -> list[str]:
    faults = []
    if not (isinstance(term.name, str) and term.name.isidentifier() and term.name == term.name.lower()):
        faults.append(f"name = {term.name!r} must be a lower-case identifier")
    own = [*(getattr(symbol, "name", symbol) for symbol in term.parameters), *term.coefficients, *term.vectors]
    faults += [f"{name!r} is a name of the flow's own" for name in own if name in UNITS or name in QUANTITIES]
    faults += [f"the name {name!r} is not of letters and digits" for name in own if not NAME.fullmatch(str(name))]
    faults += [f"two things are named {name}" for name in sorted({x for x in own if own.count(x) > 1})]
    units = {**term.parameters, **term.coefficients, **term.vectors}
    faults += [
        f"the dimension of {name} is {unit!r}, which is none"
        for name, unit in units.items()
        if not isinstance(unit, Dimension)
    ]
    faults += [f"parameters: {symbol!r} is no symbol" for symbol in term.parameters if not isinstance(symbol, Symbol)]
    if not callable(term.force):
        faults.append(f"force = {term.force!r} is no function of the flow")
    for d in (2, 3):
        faults = faults or [f"in {d} dimensions: {fault}" for fault in _force_faults(term, d)]
    return faults


def _force_faults(term: Term, d: int) -> list[str]:
    parts, own = _Parts(d, 1), {one.name: one for one in fields_of(term, d, 1)}
    try:
        force = term.force(parts.flow(own))
    except Exception as error:
        return [f"force raises {type(error).__name__}: {error}"]
    if not isinstance(force, Matrix) or force.shape != (d, 1):
        return [f"force is {force!r}, and must be a vector: a matrix of {d} rows and one column"]
    units = {
        **UNITS,
        **{symbol.name: unit for symbol, unit in term.parameters.items()},
        **term.coefficients,
        **term.vectors,
    }
    known = {symbol: units[symbol.name] for symbol in (rho, eta, *term.parameters)}
    known |= {parts.phi: DIMENSIONLESS, parts.speed: UNITS["u"]}
    for one in (parts.u, parts.p, parts.c, parts.us, *own.values()):
        for value, *slopes in one.slots:
            known |= {value: units[one.name], **dict.fromkeys(slopes, units[one.name] / LENGTH)}
    for k, expr in enumerate(force):
        unknown = sorted(str(symbol).removeprefix("own_") for symbol in expr.free_symbols - known.keys())
        if unknown:
            return [f"component {k} has {', '.join(unknown)}, which is declared nowhere"]
        try:
            unit = dimension_of(expr, known)
        except DimensionMismatchError as error:
            return [f"component {k}: {error}"]
        if unit not in (None, UNITS["force"]):
            return [f"component {k} is a {unit}, and must be a force per volume, {UNITS['force']}"]
    return []


class _Parts:
    """Fields and coefficients of the flow, and quantities that all of its terms share."""

    def __init__(self, dimension: int, order: int) -> None:
        d = self.dimension = dimension
        self.u, self.p = Field("u", d, vector=True, order=order), Field("p", d)
        self.c, self.us = Field("c", d, order=order), Field("us", d, vector=True, order=order)
        self.force, self.past, self.tried, self.pull = (
            Field(name, d, vector=True, order=order) for name in ("force", "past", "tried", "pull")
        )
        self.growth, self.friction, self.lent = (Field(name, d, order=order) for name in ("growth", "friction", "lent"))
        self.phi, self.speed = Symbol("phi", nonnegative=True), Symbol("speed", positive=True)

    @property
    def of_moving(self) -> tuple[Field, ...]:
        """What is known of grains that move by themselves."""
        return self.growth, self.friction, self.tried, self.pull, self.lent

    def flow(self, own: Mapping[str, Field]) -> Flow:
        """What a term's force may depend on."""
        values = {name: one.value for name, one in own.items()}
        return Flow(
            dimension=self.dimension,
            u=self.u.value,
            us=self.us.value,
            gradient=self.u.gradient,
            p=self.p.value,
            c=self.c.value,
            phi=self.phi,
            rho=rho,
            eta=eta,
            speed=self.speed,
            own=values,
        )


#: Names of quantities, which no parameter may have.
QUANTITIES = (
    "phi",
    "speed",
    "share",
    "slip",
    "Re",
    "K",
    "mixture",
    "resistance",
    "tau",
    *(f"{x}{k}" for x in ("slip", "rest") for k in range(3)),
)


def averaged_flow(
    dimension: int,
    order: int,
    *,
    drag: Closure | None = None,
    mixture: Closure | None = None,
    more: tuple[Term, ...] = (),
    moving: bool = False,
) -> WeakForm:
    """Averaged flow in two or three dimensions.

    Its fields are u and p; its coefficients c, us, force and past, of the velocity's order; its parameters rho, eta,
    rate, r if there is drag, and those of closures. What is absent leaves no term: rho in Stokes flow, rate and past in
    steady flow, us with grains at rest, force. Without grains c is one. Of grains that move by themselves also growth,
    dc/dt, and the force on them: friction, tried, pull and lent.

    Parameters
    ----------
    dimension : 2 or 3
    order : 1 or 2
        Of the velocity.
    drag : Closure, optional
        Of the grains, which are spheres of radius r.
    mixture : Closure, optional
        Viscosity of the mixture; without, it is that of the fluid.
    more : tuple of Term
        Forces besides.
    moving : bool
        Whether grains move by themselves; their drag is then in what is known of them.

    Raises
    ------
    LawError
        If a closure gives something else than it is taken for, or names clash.
    """
    d, parts = dimension, _Parts(dimension, order)
    u, p, c, us, force, past = parts.u, parts.p, parts.c, parts.us, parts.force, parts.past
    v, q = u.test, p.test
    numbers = _parameters(drag, mixture, more)
    own = {one.name: one for term in more for one in fields_of(term, d, order)}
    quantities: dict[Symbol, Expr] = {parts.phi: _grains(c.value)}
    without: dict[str, dict[Symbol, Expr]] = {}
    viscosity: Expr = eta
    if mixture is not None:
        viscosity = Symbol("mixture", positive=True)
        quantities[viscosity] = _at(mixture, {arguments.c: c.value, arguments.phi: parts.phi})
    resistance, resisted = S.Zero, Matrix.zeros(d, 1)
    if drag is not None:
        resistance, resisted, found = _drag(drag, parts)
        quantities |= found
        limits = {symbol: _viscous(found[symbol]) for symbol in found if symbol.name == "K"}
        without["rho"] = {symbol: expr for symbol, expr in limits.items() if _is_settled(expr)}
    if moving:
        resistance = parts.friction.value
        resisted = resistance * (u.value - parts.tried.value) - parts.pull.value + parts.lent.value * p.gradient
    quantities[parts.speed] = sqrt(dot(u.value, u.value) + LEAST_SQUARE)
    forces = {term.name: term.force(parts.flow({one.name: one for one in fields_of(term, d, order)})) for term in more}

    mean = u.gradient + us.gradient
    made = divergence(u) + parts.growth.value if moving else mean.trace()
    change = rate * u.value + past.value
    terms = {
        "inertia": rho * dot(change, v.value),
        "convection": -rho / c.value * dot(u.value, v.gradient * u.value),
        "pressure": -p.value * (c.value * divergence(v) + dot(c.gradient, v.value)),
        "viscosity": 2 * viscosity * dot(symmetric(mean), v.gradient),
        "drag": dot(resisted, v.value),
        "force": -c.value * dot(force.value, v.value),
        **{name: -dot(one, v.value) for name, one in forces.items()},
        "continuity": q.value * made,
    }
    if order == 2 and resistance != 0:
        # where the porosity changes within few elements, drag alone holds what their pressures push through
        terms["volume"] = 16 * resistance / FINENESS * made * divergence(v)
    if order == 1:
        # what varies of eta* is c, and the second derivatives of u vanish
        steepness = (
            quantities[viscosity].diff(parts.phi) * -c.gradient + quantities[viscosity].diff(c.value) * c.gradient
            if mixture is not None
            else Matrix.zeros(d, 1)
        )
        carried = (u.gradient * u.value + divergence(u) * u.value) / c.value - dot(
            u.value, c.gradient
        ) / c.value**2 * u.value
        balance = (
            rho * (change + carried)
            + c.value * p.gradient
            - 2 * symmetric(mean) * steepness
            + resisted
            - c.value * force.value
        )
        for one in forces.values():
            balance -= one
        rest = Matrix([Symbol(f"rest{k}", real=True) for k in range(d)])
        tau = Symbol("tau", positive=True)
        along = 2 * (rho / c.value) ** 2 * dot(u.value, metric(d) * u.value)
        quantities[tau] = 1 / sqrt((rho * rate) ** 2 + along + (3 * viscosity * FINENESS + resistance) ** 2)
        quantities |= dict(zip(rest, balance, strict=True))
        terms["stabilisation"] = tau * dot(q.gradient + rho / c.value * v.gradient * u.value, rest)
    return WeakForm(
        name="averaged_flow",
        dimension=d,
        fields=(u, p),
        coefficients=(c, us, force, past, *(parts.of_moving if moving else ()), *own.values()),
        terms={name: term for name, term in terms.items() if term != 0},
        parameters=tuple(numbers),
        quantities=_needed(quantities, terms.values()),
        without=without,
        degree=2 if order == 1 else 5,
        units={**UNITS, **{symbol.name: unit for symbol, unit in numbers.items()}, **_own_units(more)},
        source="averaged momentum and mass of a fluid among grains (Anderson & Jackson 1967)",
    )


def outlet(dimension: int, order: int, *, mixture: Closure | None = None) -> WeakForm:
    """What :func:`averaged_flow` takes on facets where fluid may leave, against a given pressure.

    The traction is that of developed flow, -pressure n + eta* d(u + us)/dn. Fluid that leaves carries its momentum out.
    Where it comes in, it brings half of it, so that no kinetic energy is made there: then p + rho v^2/2 is given
    (Bruneau & Fabrie, 1994; Braack & Mucha, 2014).

    Its coefficients are c, us and pressure, its parameters rho and eta, and those of the closure.

    Parameters
    ----------
    dimension : int
        2 or 3.
    order : int
        Of the velocity: 1, linear, or 2.
    mixture : Closure, optional
        Of the viscosity of the mixture.
    """
    parts = _Parts(dimension, order)
    u, p, c, us, n = parts.u, parts.p, parts.c, parts.us, normal(dimension)
    pressure = Field("pressure", dimension, order=order)
    numbers = _parameters(None, mixture, ())
    numbers.pop(rate)
    quantities: dict[Symbol, Expr] = {parts.phi: _grains(c.value)}
    viscosity: Expr = eta
    if mixture is not None:
        viscosity = Symbol("mixture", positive=True)
        quantities[viscosity] = _at(mixture, {arguments.c: c.value, arguments.phi: parts.phi})
    through = Symbol("through", real=True)
    quantities[through] = dot(u.value, n)
    carried = (3 * through + Abs(through)) / 4  # all of what leaves, half of what comes in
    terms = {
        "pressure": c.value * pressure.value * dot(n, u.test.value),
        "momentum": rho / c.value * carried * dot(u.value, u.test.value),
        "viscosity": -viscosity * dot((u.gradient + us.gradient).T * n, u.test.value),
    }
    return WeakForm(
        name="outlet",
        dimension=dimension,
        fields=(u, p),
        coefficients=(c, us, pressure),
        terms=terms,
        parameters=tuple(numbers),
        quantities=_needed(quantities, terms.values()),
        degree=3 * order,
        on_facets=True,
        units={**UNITS, **{symbol.name: unit for symbol, unit in numbers.items()}},
        source="directional do-nothing condition (Bruneau & Fabrie 1994; Braack & Mucha 2014)",
    )


def _needed(quantities: Mapping[Symbol, Expr], terms: Iterable[Expr]) -> dict[Symbol, Expr]:
    """Those quantities that terms use."""
    used = {symbol for term in terms for symbol in term.free_symbols}
    for symbol, expr in reversed(list(quantities.items())):
        used |= expr.free_symbols if symbol in used else set()
    return {symbol: expr for symbol, expr in quantities.items() if symbol in used}


def _parameters(drag: Closure | None, mixture: Closure | None, more: tuple[Term, ...]) -> dict[Symbol, Dimension]:
    """Numbers of the form, with their dimensions."""
    found = {rho: UNITS["rho"], eta: UNITS["eta"], rate: UNITS["rate"]}
    faults = []
    for closure, gives in ((drag, "drag"), (mixture, "viscosity")):
        if closure is not None and closure.gives != gives:
            faults.append(f"closure {closure.name} gives the {closure.gives}, and is taken for the {gives}")
    if mixture is not None:
        bad = sorted(str(x) for x in mixture.expression.free_symbols & {arguments.Re, arguments.slip, r, rho})
        faults += (
            [f"closure {mixture.name}: a viscosity of the mixture that depends on {', '.join(bad)}"] if bad else []
        )
    found |= {r: UNITS["r"]} if drag is not None else {}
    parts: list[Closure | Term] = [*(closure for closure in (drag, mixture) if closure is not None), *more]
    for one in parts:
        for symbol, unit in one.parameters.items():
            same = next((known for known in found if known.name == symbol.name), None)
            if symbol != eta and same is not None and (same != symbol or found[same] != unit):
                faults.append(
                    f"{symbol} of {one.name} is another one than that of the flow, or of another closure or term"
                )
            elif symbol.name in QUANTITIES:
                faults.append(f"{symbol} of {one.name} is a name of the flow's own")
            else:
                found[symbol] = unit
    names = [name for term in more for name in (*term.coefficients, *term.vectors)]
    faults += [f"two terms have {name}" for name in sorted({name for name in names if names.count(name) > 1})]
    faults += [
        f"two terms are named {x}" for x in sorted({t.name for t in more if sum(t.name == y.name for y in more) > 1})
    ]
    if faults:
        raise LawError("averaged_flow", tuple(faults), "weak form")
    return found


def _own_units(more: tuple[Term, ...]) -> dict[str, Dimension]:
    return {name: unit for term in more for name, unit in (*term.coefficients.items(), *term.vectors.items())}


def _grains(c: Expr) -> Expr:
    """Share of the grains. A quadratic c that is 1 at nodes may be more than that between them."""
    return Piecewise((1 - c, c < 1), (0, True))


def _at(closure: Closure, values: Mapping[Symbol, Expr]) -> Expr:
    """A closure's expression with the flow's symbols in the place of its arguments."""
    return closure.expression.xreplace(dict(values))


def _drag(drag: Closure, parts: _Parts) -> tuple[Expr, Any, dict[Symbol, Expr]]:
    """Resistance to the fluid's flux, the force on grains per volume, and the quantities that these take."""
    d, c, phi = parts.dimension, parts.c.value, parts.phi
    share, size, number = Symbol("share", positive=True), Symbol("slip", positive=True), Symbol("Re", positive=True)
    friction = Symbol("K", positive=True)
    slip = Matrix([Symbol(f"slip{k}", real=True) for k in range(d)])
    volume = Rational(4, 3) * pi * r**3
    made: dict[Symbol, Expr] = {share: sqrt(phi**2 + LEAST_PHI**2)}
    made |= dict(zip(slip, parts.u.value / c - parts.us.value / share, strict=True))
    made[size] = sqrt(dot(slip, slip) + LEAST_SQUARE)
    made[number] = sqrt(arguments.REYNOLDS.subs(arguments.slip, 1) ** 2 * dot(slip, slip) + LEAST_RE**2)
    # powers of phi are finite where there are no grains
    made[friction] = _at(drag, {arguments.c: c, arguments.phi: share, arguments.Re: number, arguments.slip: size})
    return phi * friction / (volume * c), phi * friction / volume * slip, made


def _is_settled(expr: Expr | None) -> bool:
    """Whether a limit was found, and is one."""
    return expr is not None and not expr.has(Limit, S.Infinity, S.NaN, S.ComplexInfinity, Symbol("Re", positive=True))


def _viscous(friction: Expr) -> Expr | None:
    """Limit of a friction at small Re; None if sympy does not find it, and then it is taken at the least Re."""
    number = Symbol("Re", positive=True)

    def decided(cases: Piecewise) -> Expr:
        return Piecewise(*((expr, condition.subs(number, 0)) for expr, condition in cases.args))

    friction = friction.replace(lambda node: isinstance(node, Piecewise), decided)
    try:
        if isinstance(friction, Piecewise):
            return Piecewise(*((limit(expr, number, 0, "+"), condition) for expr, condition in friction.args))
        return limit(friction, number, 0, "+")
    except (NotImplementedError, ValueError, TypeError, RecursionError):
        return None
