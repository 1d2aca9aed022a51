"""The stock laws are what they say: their constants against independent computations, their claims, and their films."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import brenner
import mpmath
import numpy as np
import pytest
from kernels_by_text import TextKernel
from reference import ulp
from sympy import Abs, Expr, I, Integer, Rational, S, Symbol, lambdify, pi, powsimp, simplify, sqrt
from test_limits import findings, variant
from test_targets import OUTPUTS, PARAMETERS, conditioned, random_states

import softdyn
from softdyn.derive import ContactLaw, E, F, Limit, R, a, delta, eta, h
from softdyn.derive.films import Films, find_films
from softdyn.derive.law import parameters_of, sample_values
from softdyn.derive.laws import cone, dlvo, droplet, equal_spheres, soap_film, steric
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.derive.limits import check_limits
from softdyn.derive.pair_equations import Needs
from softdyn.derive.regimes import discover
from softdyn.errors import SceneError
from softdyn.laws import stock_laws
from softdyn.study.two_laws import compare, comparison_text

LAWS: dict[str, ContactLaw] = {
    module.law.name: module.law for module in (equal_spheres, droplet, cone, dlvo, steric, soap_film)
}
WITH_FILMS = ("dlvo", "steric", "soap_film")
#: Laws of many own parameters, and a mutant that cancels: their proofs take some seconds each.
HEAVY = ("dlvo", "steric", "the film's area alone")

d = Symbol("delta", positive=True)  # the size of delta, as findings name it
nu = equal_spheres.nu


def by_name(names: Any) -> list[Any]:
    """Parameters of a test, the heavy ones marked slow."""
    return [pytest.param(name, marks=pytest.mark.slow) if name in HEAVY else name for name in names]


def numbers(law: ContactLaw) -> dict[Symbol, Rational]:
    """R = E = eta = 1, and the law's own parameters at typical values."""
    return {R: S.One, E: S.One, eta: S.One, **sample_values(law)}


def of_state(law: ContactLaw, expr: Expr) -> Callable[..., mpmath.mpf]:
    """An expression of a law as a function of h and delta, in mpmath."""
    return lambdify((h, delta), expr.subs(a, law.a).subs(numbers(law)), "mpmath")


# ------------------------------------------------------------------------------------------------------ what is claimed


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in ("rognon_gay", "cone") else pytest.mark.slow) for name in LAWS],
)
def test_every_claim_of_a_stock_law_is_proved(name: str) -> None:
    found = check_limits(LAWS[name])
    assert len(found) >= 10
    assert {(f.limit, f.quantity): f.reason for f in found if f.verdict != "proved"} == {}


def test_stock_laws_are_named_as_their_files() -> None:
    assert set(LAWS) <= set(stock_laws())
    for name in stock_laws():
        assert import_module(f"softdyn.derive.laws.{name}").law.name == name


# -------------------------------------------------------------------------------------------------------------- mutants

#: How a law is altered, the limit and quantity that show it, and the ratio found/claimed.
Mutant = tuple[dict[str, Any], str, str, Expr]


def claim(law: ContactLaw, limit: str, quantity: str) -> Expr:
    """What a law claims."""
    return next(x for x in law.limits if x.name == limit).claims[quantity]


def altered(law: ContactLaw, name: str, **changes: Callable[[Expr], Expr]) -> dict[str, Any]:
    """A change of a law's expressions."""
    return {key: change(getattr(law, key)) for key, change in changes.items()}


def halved_radius(expr: Expr) -> Expr:
    return expr.subs(R, R / 2)


def twice(expr: Expr) -> Expr:
    return 2 * expr


def off_by_a_half(expr: Expr) -> Expr:
    return expr * sqrt(h / R)


def mutants_of(law: ContactLaw) -> dict[str, Mutant]:
    """Wrong variants of any of these laws: the first limit with a friction, and one of each kind."""
    with_friction = [x for x in law.limits if "zeta" in x.claims and not x.name.endswith("pulled")]
    first, *_, last = with_friction
    swapped = powsimp(last.claims["zeta"] / first.claims["zeta"]).subs(delta, d)
    made: dict[str, Mutant] = {
        "friction doubled": (altered(law, "zeta", zeta=twice), last.name, "zeta", Integer(2)),
        "friction's power off by 1/2": (altered(law, "zeta", zeta=off_by_a_half), last.name, "zeta", sqrt(h / R)),
    }
    if not swapped.has(F):
        wrong = replace(last, claims={"zeta": first.claims["zeta"]})
        made["regimes swapped"] = ({"limits": (wrong,)}, last.name, "zeta", swapped)
    return made


def wrong_claim(law: ContactLaw, limit: str, quantity: str, change: Callable[[Expr], Expr]) -> dict[str, Any]:
    """A law with one claim altered."""
    right = next(x for x in law.limits if x.name == limit)
    return {"limits": (replace(right, claims={quantity: change(right.claims[quantity])}),)}


def pulled(quantity: str, form: Expr) -> dict[str, Any]:
    """A law with a claim of strong tension instead of its own."""
    return {"limits": (Limit("pulled", (h, -delta, R), {quantity: form}),)}


def negative(expr: Expr) -> Expr:
    return -expr


SPHERES = LAWS["equal_spheres"]
HALF, TWO = S.Half, Integer(2)
MUTANTS: dict[str, dict[str, Mutant]] = {name: mutants_of(law) for name, law in LAWS.items()}
MUTANTS["equal_spheres"] |= {
    "modulus doubled": (altered(SPHERES, "", F_ela=twice), "Hertz", "delta", TWO ** Rational(-2, 3)),
    "incompressible, whatever nu": (
        {"F_ela": SPHERES.F_ela.subs(nu, 0)},
        "Poiseuille",
        "delta",
        1 / (1 - nu**2),
    ),
    "sign of delta": (wrong_claim(SPHERES, "Hertz", "delta", negative), "Hertz", "delta", -S.One),
    "missing abs": (pulled("a", sqrt(R * delta)), "pulled", "a", -3 * I * h / (2 * d)),
    "wrong effective radius": (altered(SPHERES, "", a=halved_radius), "Hertz", "a", 1 / sqrt(2)),
    "the paper's alpha": ({"F_ela": Rational(4, 9) * E * a * delta}, "Stokes", "delta", 3 / (1 - nu**2)),
    "the paper's friction": ({"zeta": rognon_gay.zeta}, "Poiseuille", "zeta", Rational(81, 16)),
    "drainage between discs": (
        wrong_claim(SPHERES, "Hertz", "dh_dt", lambda x: x * Rational(8, 3)),
        "Hertz",
        "dh_dt",
        Rational(3, 8),
    ),
}
MUTANTS["droplet"] |= {
    "tension doubled": (altered(droplet.law, "", F_ela=twice), "Poiseuille", "delta", HALF),
    "sign of delta": (wrong_claim(droplet.law, "film", "delta", negative), "film", "delta", -S.One),
    "missing abs": (pulled("a", sqrt(2 * R * delta)), "pulled", "a", -I * h / d),
    "wrong effective radius": (altered(droplet.law, "", a=halved_radius), "film", "a", 1 / sqrt(2)),
    "Hertz's spring": (
        {"F_ela": 4 * pi * droplet.sigma * a * delta / R},
        "film",
        "delta",
        sqrt(R) / (sqrt(2) * sqrt(d)),
    ),
}
MUTANTS["cone"] |= {
    "modulus doubled": (altered(cone.law, "", F_ela=twice), "cones", "delta", 1 / sqrt(2)),
    "sign of delta": (wrong_claim(cone.law, "cones", "delta", negative), "cones", "delta", -S.One),
    "missing abs": (wrong_claim(cone.law, "cones, pulled", "a", negative), "cones, pulled", "a", -S.One),
    "wrong effective radius": (altered(cone.law, "", a=halved_radius), "round tips", "a", 1 / sqrt(2)),
    "slope for its inverse": (
        {"a": cone.law.a.subs(cone.m, 1 / cone.m)},
        "cones",
        "a",
        cone.m**2,
    ),
}
MUTANTS["dlvo"] |= {
    "sign of the force": (altered(dlvo.law, "", F_adh=negative), "double layer", "F_adh", -S.One),
    "sign of delta": (wrong_claim(dlvo.law, "Poiseuille", "delta", negative), "Poiseuille", "delta", -S.One),
    "missing abs": (pulled("a", sqrt(R * delta)), "pulled", "a", -3 * I * h / (2 * d)),
    "wrong effective radius": (altered(dlvo.law, "", F_adh=halved_radius), "double layer", "F_adh", HALF),
    "pressure for its integral": (
        {"F_adh": dlvo.law.F_adh.subs(dlvo.A, 2 * dlvo.A * R / h)},
        "far",
        "F_adh",
        2 * R / h,
    ),
    "Debye length doubled": (
        {"F_adh": dlvo.law.F_adh.subs(dlvo.ell, 2 * dlvo.ell)},
        "double layer",
        "F_adh",
        TWO,
    ),
}
MUTANTS["steric"] |= {
    "sign of the force": (altered(steric.law, "", F_adh=negative), "brushes", "F_adh", -S.One),
    "sign of delta": (wrong_claim(steric.law, "Hertz", "delta", negative), "Hertz", "delta", -S.One),
    "missing abs": (pulled("a", sqrt(R * delta)), "pulled", "a", -3 * I * h / (2 * d)),
    "wrong effective radius": (altered(steric.law, "", F_adh=halved_radius), "brushes", "F_adh", HALF),
    "brushes that touch at L": (
        {"F_adh": steric.law.F_adh.subs(steric.L, steric.L / 2)},
        "brushes",
        "F_adh",
        TWO ** Rational(-9, 4),
    ),
    "force's power off by 1/2": (altered(steric.law, "", F_adh=off_by_a_half), "brushes", "F_adh", sqrt(h / R)),
}
MUTANTS["soap_film"] |= {
    "sign of the force": (altered(soap_film.law, "", F_adh=negative), "film, repelled", "F_adh", -S.One),
    "sign of delta": (wrong_claim(soap_film.law, "Poiseuille", "delta", negative), "Poiseuille", "delta", -S.One),
    "missing abs": (pulled("a", sqrt(2 * R * delta)), "pulled", "a", -I * h / d),
    "wrong effective radius": (altered(soap_film.law, "", F_adh=halved_radius), "round, repelled", "F_adh", HALF),
    "the film's area alone": (
        {"F_adh": soap_film.law.F_adh - soap_film.law.F_adh.subs(a, sqrt(2 * R * soap_film.hbar))},
        "round, repelled",
        "F_adh",
        2 * d / soap_film.ell,
    ),
    "round spheres alone": (
        {"F_adh": soap_film.law.F_adh.subs(a, sqrt(2 * R * soap_film.hbar))},
        "film, repelled",
        "F_adh",
        soap_film.ell / (2 * d),
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law_name", "mutant"),
    [
        pytest.param(
            name, mutant, marks=pytest.mark.slow if name in HEAVY or mutant in HEAVY else (), id=f"{name}: {mutant}"
        )
        for name, mutants in MUTANTS.items()
        for mutant in mutants
    ],
)
def test_a_wrong_variant_is_refuted_with_the_exact_ratio(law_name: str, mutant: str) -> None:
    law = LAWS[law_name]
    changes, limit_name, quantity, ratio = MUTANTS[law_name][mutant]
    wrong = variant(law, **changes)
    limit = next(x for x in wrong.limits if x.name == limit_name)
    (finding,) = findings(wrong, replace(limit, claims={quantity: limit.claims[quantity]})).values()
    assert finding.verdict == "disproved", finding.reason
    assert finding.ratio is not None
    assert simplify(finding.ratio / ratio) == 1, finding.ratio


def test_there_are_six_mutants_of_every_law() -> None:
    assert {name: len(mutants) for name, mutants in MUTANTS.items() if len(mutants) < 6} == {}


# ---------------------------------------------------------------------------------------------- equal spheres: friction

#: physics.md, section 2: Brenner's series at h/R = 1e-4 ... 1e2.
BRENNER = (5005.490, 504.4546, 53.42229, 7.413298, 2.038655, 1.142336, 1.014924)


@cache
def brenner_series(gap: float) -> mpmath.mpf:
    return brenner.friction(mpmath.mpf(gap))


def test_the_series_is_summed_right() -> None:
    for decade, value in zip(range(-4, 3), BRENNER, strict=True):
        assert float(brenner_series(10.0**decade)) == pytest.approx(value, rel=1e-6)


@pytest.mark.slow
def test_the_friction_of_equal_spheres_is_brenners_within_one_percent() -> None:
    """At delta = 0, over h/R = 1e-4 ... 1e2; droplet has the same."""
    gaps = np.geomspace(1e-4, 1e2, 49)
    for law in (SPHERES, droplet.law):
        friction = of_state(law, law.zeta / (3 * pi * eta * R))
        errors = [float(friction(gap, 0) / brenner_series(float(gap)) - 1) for gap in gaps]
        assert max(map(abs, errors)) < 0.008
        assert max(map(abs, errors)) > 0.004, "the fit is said to be good to 0.7 %: neither better nor worse"


def test_both_ends_of_the_friction_are_exact() -> None:
    """Beyond the fit's range too: R/(2 h) + (9/20) ln(R/h) + 1.3456 near contact, 1 + (3/2)(R/h) far away."""
    friction = of_state(SPHERES, SPHERES.zeta / (3 * pi * eta * R))
    near, far = mpmath.mpf("1e-9"), mpmath.mpf("1e6")
    assert abs(friction(near, 0) * 2 * near - 1) < 1e-7
    assert abs((friction(far, 0) - 1) * far / 1.5 - 1) < 1e-5


# -------------------------------------------------------------------------------------------- equal spheres: elasticity


def test_the_lubrication_pressure_deflects_as_the_law_says() -> None:
    """At delta << h << R: half-spaces under p = (1 + r^2/(R h))^-2, of total force pi R h; lengths in sqrt(R h)."""

    def pressure(r: mpmath.mpf) -> mpmath.mpf:
        return (1 + r**2) ** -2

    total = 2 * mpmath.pi * mpmath.quad(lambda r: r * pressure(r), [0, 1, 10, mpmath.inf])
    centre = brenner.deflection(pressure, mpmath.mpf(0), mpmath.inf)
    # F = 2 E/(1 - nu^2) sqrt(R h) delta
    assert abs(total / centre / 2 - 1) < 1e-12
    gap, depth = mpmath.mpf("1e-10"), mpmath.mpf("1e-24")
    force = of_state(SPHERES, SPHERES.F_ela * (1 - nu**2))
    assert abs(force(gap, depth) / (2 * mpmath.sqrt(gap) * depth) - 1) < 1e-9


def test_hertz_is_a_contact_of_flat_discs_in_the_middle() -> None:
    """Under the pressure of the law's F and a, surfaces flatten: the deflection falls by r^2/(2 R) from its centre."""
    depth = mpmath.mpf("1e-12")
    radius = of_state(SPHERES, SPHERES.a)(mpmath.mpf("1e-26"), depth)
    force = of_state(SPHERES, SPHERES.F_ela * (1 - nu**2))(mpmath.mpf("1e-26"), depth)

    def pressure(r: mpmath.mpf) -> mpmath.mpf:
        return 3 * force / (2 * mpmath.pi * radius**2) * mpmath.sqrt(abs(1 - (r / radius) ** 2))

    centre = brenner.deflection(pressure, mpmath.mpf(0), radius)
    assert abs(centre / depth - 1) < 1e-9
    for part in (0.3, 0.7, 0.95):
        r = part * radius
        fallen = centre - brenner.deflection(pressure, r, radius)
        assert abs(fallen / (r**2 / 2) - 1) < 1e-6


@pytest.mark.parametrize("poisson", [-0.5, 0.0, 0.3, 0.5])
def test_hertz_in_its_usual_form(poisson: float) -> None:
    """F = (4/3) E* sqrt(R*) D^(3/2), with 1/E* = 2 (1 - nu^2)/E, R* = R/2 and the approach D = 2 delta."""
    at = {**numbers(SPHERES), nu: Rational(str(poisson)), h: Rational(1, 10**20), delta: Rational(1, 10**6)}
    force = SPHERES.F_ela.subs(a, SPHERES.a).subs(at).evalf(30)
    modulus = 1 / (2 * (1 - poisson**2))
    assert float(force) == pytest.approx(4 / 3 * modulus * np.sqrt(0.5) * (2e-6) ** 1.5, rel=1e-12)


def flattened(r: mpmath.mpf) -> mpmath.mpf:
    """1 - u(r)/u(0) of half-spaces under (1 + r^2)^-2: u(r) is (2/pi) integral of k K1(k) J0(k r)."""
    return 1 - mpmath.hyp2f1(mpmath.mpf(3) / 2, mpmath.mpf(1) / 2, 1, -(r**2))


def test_how_a_half_space_deflects_under_lubrication() -> None:
    for r in (mpmath.mpf("0.4"), mpmath.mpf(2)):
        centre = brenner.deflection(lambda s: (1 + s**2) ** -2, mpmath.mpf(0), mpmath.inf)
        there = brenner.deflection(lambda s: (1 + s**2) ** -2, r, mpmath.mpf(1000))
        # the pressure beyond 1000 is left out: it deflects by 2/(3 1000^3)
        assert abs(1 - there / centre - flattened(r)) < 1e-8


@pytest.mark.slow
def test_first_corrections_are_those_of_lubrication_between_deflected_surfaces() -> None:
    """To first order in e = delta/h, the profile is 1 + r^2 - 2 e f(r), in units of h and sqrt(R h).

    Reynolds: r (profile)^3 p' = q, with q' = r for surfaces of constant shape; at constant force, where the shape
    relaxes as delta ~ h^(-1/2) and sqrt(R h) goes with h, q' = r (1 + e (f + r f')). Force and central deflection are
    integrals of q over the cube of the profile.
    """
    ends = [0, 1, 3, 10, 100, mpmath.inf]
    f = flattened

    def relaxing(r: mpmath.mpf) -> mpmath.mpf:
        """Integral of r (f + r f') from 0."""
        under = mpmath.hyp2f1(mpmath.mpf(3) / 2, mpmath.mpf(1) / 2, 2, -(r**2)) * r**2 / 2  # of r (1 - f)
        return r**2 * f(r) - r**2 / 2 + under

    def first(weight: Callable[[mpmath.mpf], mpmath.mpf], relaxes: bool) -> mpmath.mpf:
        """First correction to the integral of weight q/profile^3, relative to it."""

        def integrand(r: mpmath.mpf) -> mpmath.mpf:
            return weight(r) * (
                (relaxing(r) if relaxes else 0) / (1 + r * r) ** 3 + 3 * r * r * f(r) / (1 + r * r) ** 4
            )

        return mpmath.quad(integrand, ends) / mpmath.quad(lambda r: weight(r) * r * r / 2 / (1 + r * r) ** 3, ends)

    of_friction, of_depth = first(lambda r: r, True), first(lambda r: mpmath.mpf(1), True)
    held = first(lambda r: r, False)
    gap, small = mpmath.mpf("1e-20"), mpmath.mpf("1e-10")
    friction, radius = of_state(SPHERES, SPHERES.zeta), of_state(SPHERES, SPHERES.a)
    slope = (friction(gap, small * gap) / friction(gap, 0) - 1) / small
    # a^2/(R h) = 9/4 (1 + 2 e (of_friction - of_depth)): at the same force, less deflection is a larger a
    growth = ((radius(gap, small * gap) / radius(gap, 0)) ** 2 - 1) / small * mpmath.mpf(9) / 4
    assert abs(growth / (mpmath.mpf(9) / 2 * (of_friction - of_depth)) - 1) < 0.01
    assert abs(of_friction - 1.51) < 0.005
    assert abs(held - 0.80) < 0.005
    assert abs(slope - 1) < 1e-5, "between the two"


def test_a_flattened_contact_drains_at_its_centre_as_claimed() -> None:
    """Reynolds under Hertz's pressure, dh/dt = h^3/(12 eta) laplacian(p) at r = 0: 3/8 of the rate between discs."""
    gap, depth = mpmath.mpf("1e-16"), mpmath.mpf("1e-8")
    radius, force = mpmath.sqrt(depth), mpmath.mpf(1)

    def pressure(r: mpmath.mpf) -> mpmath.mpf:
        return 3 * force / (2 * mpmath.pi * radius**2) * mpmath.sqrt(1 - (r / radius) ** 2)

    with mpmath.workdps(40):
        rate = gap**3 / 12 * 2 * mpmath.diff(pressure, 0, 2)  # the Laplacian at the centre is 2 p''
        discs = -2 * force * gap**3 / (3 * mpmath.pi * radius**4)
        law_rate = -force / of_state(SPHERES, SPHERES.zeta)(gap, depth)
    assert abs(rate / discs - mpmath.mpf(3) / 8) < 1e-12
    assert abs(law_rate / rate - 1) < 4 * gap / depth


@pytest.mark.slow
@pytest.mark.parametrize("name", ["equal_spheres", "droplet"])
def test_what_is_pulled_apart_moves_apart(name: str) -> None:
    """D > 0 throughout: with a^2 = R ((9/4) hbar + abs(delta)) instead, centres would approach at -delta > 3 h."""
    law = LAWS[name]
    kernel = get_kernel_of(law)
    gaps, depths = (x.ravel() for x in np.meshgrid(np.geomspace(1e-9, 1e3, 60), -np.geomspace(1e-12, 0.99, 60)))
    p = np.array([float(numbers(law)[symbol]) for symbol in parameters_of(law)])
    out = kernel(p, gaps, depths)["D"]
    assert (out > 0).all()


def get_kernel_of(law: ContactLaw) -> Callable[..., dict[str, np.ndarray]]:
    """The kernel from the cache, as a function of p, h and delta."""
    from softdyn.kernels import get_kernel

    kernel = get_kernel(law, drive="table", outputs=OUTPUTS)

    def evaluate(p: np.ndarray, gaps: np.ndarray, depths: np.ndarray) -> dict[str, np.ndarray]:
        out = np.empty(len(OUTPUTS) * len(gaps))
        zero = np.zeros(len(gaps))
        inputs = [{"F": zero + 1.0, "dF_dt": zero}[name] for name in kernel.inputs]
        kernel.functions.evaluate(len(gaps), gaps, depths, *inputs, p, out)
        return dict(zip(OUTPUTS, out.reshape(len(OUTPUTS), -1), strict=True))

    return evaluate


# ---------------------------------------------------------------------------------------------------------- the kernels


@cache
def states_of(name: str) -> Any:
    """Some hundred states of a law in SI units, its exact outputs there, and their sizes."""
    law = LAWS[name]
    units = dict(zip((R, E, eta), PARAMETERS[1], strict=True))
    own = {
        symbol: float(value.subs(units)) if isinstance(value, Expr) else value for symbol, value in law.typical.items()
    }
    states = random_states(7, 200, *PARAMETERS[1])
    states = replace(states, p=np.array([float({**units, **own}[symbol]) for symbol in parameters_of(law)]))
    return (states, *conditioned(law, states))


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", "numba"])
@pytest.mark.parametrize("name", list(LAWS))
def test_kernels_agree_with_50_digits(name: str, target: str, tmp_path: Path) -> None:
    """What rounded arguments do, the sizes hold (see test_targets); what is left is a chain of 16 roundings."""
    states, values, sizes = states_of(name)
    kernel = TextKernel(LAWS[name], Needs(drive="table", outputs=OUTPUTS), target, tmp_path)
    computed = kernel.evaluate(states.p, states.h, states.delta, F=states.F, dF_dt=states.dF_dt)
    worst = {output: float((values[output].error(computed[output]) / ulp(sizes[output])).max()) for output in OUTPUTS}
    print(worst)
    assert {output: error for output, error in worst.items() if not error <= 16} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n == "dlvo" else []) for n in LAWS])
def test_a_law_runs(name: str) -> None:
    """A small scene, by the integrator and by quadrature: they share the law's kernel, and nothing else."""
    law = LAWS[name]
    at = numbers(law)
    scene: dict[str, Any] = {
        "law": name,
        "parameters": {symbol.name: float(at[symbol]) for symbol in parameters_of(law)},
        "h": 2.0,
        "force": 1e-2,
        "until_h": 0.02,
        "gaps": 5,
    }
    run = softdyn.simulate(**scene)
    exact = softdyn.simulate(**scene, method="quadrature")
    assert run.h[-1] == pytest.approx(0.02, rel=1e-9)
    np.testing.assert_allclose(run.t[1:], exact.t[1:], rtol=1e-7)  # rtol = 1e-9 at each of some 30 steps


# -------------------------------------------------------------------------------------------------------- remote forces


@pytest.mark.parametrize("gap", ["0.0002", "0.001", "0.0031"])
def test_remote_forces_are_derjaguins(gap: str) -> None:
    """Between round spheres F = pi R times the integral of the pressure from h on."""
    at = mpmath.mpf(gap)
    own = {s.name: mpmath.mpf(x.p) / x.q for law in (dlvo.law, steric.law) for s, x in numbers(law).items()}

    def double_layers(x: mpmath.mpf) -> mpmath.mpf:
        return mpmath.exp(-x / own["ell"]) / 3 - own["A"] / (6 * mpmath.pi * x**3)

    def brushes(x: mpmath.mpf) -> mpmath.mpf:
        ratio = 2 * own["L"] / x
        return mpmath.mpf(3) / 2 * (ratio ** mpmath.mpf("2.25") - ratio ** mpmath.mpf("-0.75"))

    found = of_state(dlvo.law, dlvo.law.F_adh)(at, 0)
    expected = mpmath.pi * mpmath.quad(double_layers, [at, 2 * at, 10 * at, 100 * at, mpmath.inf])
    assert abs(found / expected - 1) < 1e-8
    found = of_state(steric.law, steric.law.F_adh)(at, 0)
    expected = mpmath.pi * mpmath.quad(brushes, [at, 2 * own["L"]]) if at < 2 * own["L"] else mpmath.mpf(0)
    assert abs(found - expected) <= 1e-10 * abs(expected)


def test_brushes_touch_smoothly() -> None:
    """Force and slope vanish at h = 2 L: as the square of what is left, and as what is left."""
    force = of_state(steric.law, steric.law.F_adh)
    with mpmath.workdps(40):
        reach = mpmath.mpf(2) / 1000
    for left in (mpmath.mpf("1e-6"), mpmath.mpf("1e-9")):
        with mpmath.workdps(40):  # three terms cancel to the second order
            inside = force(reach * (1 - left), 0)
        # the pressure starts as (9/4 + 3/4) Pi0 left: F ~ pi R Pi0 (3/2) 2 L left^2
        assert abs(inside / (mpmath.pi * mpmath.mpf(3) / 2 * mpmath.mpf(3) / 2 * reach * left**2) - 1) < 10 * left
        assert force(reach * (1 + left), 0) == 0


def test_the_soap_films_force_is_the_pressure_over_its_profile() -> None:
    """A plane of area 2 pi R delta, and a rim that rises as (r^2 - 2 R delta)/R: the integral of the pressure."""
    gap, depth, reach, scale = (mpmath.mpf(x) for x in ("3e-4", "2e-3", "1e-4", "333"))

    def pressure(r: mpmath.mpf) -> mpmath.mpf:
        return scale * mpmath.exp(-(gap + max(r**2 - 2 * depth, 0)) / reach)

    edge = mpmath.sqrt(2 * depth)
    total = 2 * mpmath.pi * mpmath.quad(lambda r: r * pressure(r), [0, edge, 1.1 * edge, 2 * edge, 10 * edge])
    assert abs(of_state(soap_film.law, soap_film.law.F_adh)(gap, depth) / total - 1) < 1e-9


# ---------------------------------------------------------------------------------------------------------------- films


class Contact:
    """A law at its typical parameters, in mpmath, from its four expressions alone."""

    def __init__(self, law: ContactLaw) -> None:
        self.elastic = of_state(law, law.F_ela)
        self.friction = of_state(law, law.zeta)
        self.remote = of_state(law, law.F_adh)

    def deflection(self, gap: mpmath.mpf, force: mpmath.mpf) -> mpmath.mpf:
        """Solve F_ela = force for delta: the logarithm of one against that of the other, by the secant method."""

        def excess(power: mpmath.mpf) -> mpmath.mpf:
            return mpmath.log(self.elastic(gap, side * mpmath.exp(power)) / force)

        side = 1 if force > 0 else -1
        before, power = mpmath.log(abs(force)), mpmath.log(abs(force)) + 1
        off_before, off = excess(before), excess(power)
        while abs(off) > mpmath.mpf(10) ** (6 - mpmath.mp.dps):
            before, power = power, power - off * (power - before) / (off - off_before)
            off_before, off = off, excess(power)
        return side * mpmath.exp(power)

    def rate(self, gap: mpmath.mpf, force: mpmath.mpf) -> mpmath.mpf:
        """dh/dt at constant force."""
        depth = self.deflection(gap, force)
        return -(force - self.remote(gap, depth)) / self.friction(gap, depth)

    def relaxation(self, gap: mpmath.mpf, force: mpmath.mpf) -> mpmath.mpf:
        """-d(dh/dt)/dh, by a central difference."""
        step = gap * mpmath.mpf("1e-8")
        return -(self.rate(gap + step, force) - self.rate(gap - step, force)) / (2 * step)

    def film(self, low: mpmath.mpf, high: mpmath.mpf, force: mpmath.mpf) -> mpmath.mpf:
        """A gap between two at which dh/dt = 0, by bisection."""
        falls = self.rate(low, force) > 0
        assert (self.rate(high, force) > 0) != falls, "no film between"
        for _ in range(70):
            middle = mpmath.sqrt(low * high)
            if (self.rate(middle, force) > 0) == falls:
                low = middle
            else:
                high = middle
        return mpmath.sqrt(low * high)

    def all_films(self, force: float) -> list[mpmath.mpf]:
        """Every film at a force, from a scan over the gaps at which films are looked for."""
        gaps = [mpmath.mpf(10) ** (mpmath.mpf(k) / 25) for k in range(-150, 25)]
        rates = [self.rate(gap, mpmath.mpf(force)) for gap in gaps]
        return [
            self.film(gaps[i], gaps[i + 1], mpmath.mpf(force))
            for i in range(len(gaps) - 1)
            if (rates[i] > 0) != (rates[i + 1] > 0)
        ]


@cache
def films_of(name: str) -> Films:
    found = find_films(discover(LAWS[name]))
    assert found is not None
    return found


FILMS = [pytest.param(name, marks=pytest.mark.slow) if name in HEAVY else name for name in WITH_FILMS]


@pytest.mark.slow
@pytest.mark.parametrize("name", FILMS)
def test_films_are_where_the_gap_rests(name: str) -> None:
    """Each film found is a zero of dh/dt, stable or not, and relaxes, as the law in mpmath says."""
    contact = Contact(LAWS[name])
    checked = 0
    with mpmath.workdps(40):
        for branch in films_of(name).branches:
            samples = [i for i, force in enumerate(branch.force) if 1e-12 < abs(force) < 0.3]
            for i in samples[:: max(1, len(samples) // 5)]:
                gap, force = mpmath.mpf(branch.h[i]), mpmath.mpf(branch.force[i])
                steepness = abs(contact.relaxation(gap, force)) * contact.friction(gap, contact.deflection(gap, force))
                if gap * steepness < 1e-3 * abs(force):
                    continue  # near the largest force that a film bears, its gap is no function of the force
                # the film's force is rounded: its gap is off by that, over the slope of ln(force)
                off = mpmath.mpf(2) ** -40 * abs(force) / steepness + gap * mpmath.mpf("1e-12")
                found = contact.film(gap - off, gap + off, force)
                rate = contact.relaxation(found, force)
                assert (rate > 0) == branch.stable
                assert abs(branch.rate[i] / rate - 1) < 1e-6 + 100 * off / gap
                checked += 1
    assert checked >= 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "force"),
    [
        *((pytest.param("dlvo", force, marks=pytest.mark.slow)) for force in (1e-4, 5e-4, 2e-3, -1e-8)),
        *((pytest.param("steric", force, marks=pytest.mark.slow)) for force in (1e-5, 1e-2)),
        *(("soap_film", force) for force in (1e-4, 3e-1)),
    ],
)
def test_no_film_is_missed(name: str, force: float) -> None:
    """As many films at a force as there are branches through it, each between two of a branch's samples."""
    with mpmath.workdps(30):
        expected = [float(gap) for gap in Contact(LAWS[name]).all_films(force)]
    found = []
    for branch in films_of(name).branches:
        for i in range(len(branch.h) - 1):
            ends = sorted(branch.force[i : i + 2])
            if ends[0] <= force <= ends[1]:
                found.append((branch.h[i], branch.h[i + 1]))
    assert len(found) == len(expected)
    for gap, (low, high) in zip(expected, sorted(found), strict=True):
        assert low <= gap <= high


def test_the_film_of_dlvo_has_a_barrier_and_a_second_minimum() -> None:
    """At small forces two films, unstable below stable; none beyond the barrier; in tension, the second minimum."""
    with mpmath.workdps(30):
        contact = Contact(dlvo.law)
        assert len(contact.all_films(1e-4)) == 2
        assert contact.all_films(2e-3) == []
        below, above = contact.all_films(1e-4)
        assert contact.relaxation(below, mpmath.mpf("1e-4")) < 0 < contact.relaxation(above, mpmath.mpf("1e-4"))
        # pulled by less than the second minimum holds: barrier, minimum, and the attraction's end
        assert len(contact.all_films(-1e-8)) == 3


def test_a_black_film_does_not_depend_on_the_force() -> None:
    """Pi0 exp(-h/ell) = 2 sigma/R, up to the share of the rim, ell/(2 delta): 51 nm for the typical film."""
    laplace = mpmath.log(mpmath.mpf(333) / 2) / 10**4
    with mpmath.workdps(30):
        contact = Contact(soap_film.law)
        for force in (0.1, 0.3, 1.0):
            (gap,) = contact.all_films(force)
            share = mpmath.mpf("1e-4") / (2 * contact.deflection(gap, mpmath.mpf(force)))
            assert abs((gap - laplace) * 10**4 - mpmath.log(1 + share)) < 1e-6
    assert float(laplace) == pytest.approx(5.1e-4, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "force"), [("dlvo", 1e-4), ("steric", 1e-2), ("soap_film", 0.1)])
def test_a_pair_settles_on_its_film_at_the_rate_predicted(name: str, force: float) -> None:
    law = LAWS[name]
    with mpmath.workdps(30):
        contact = Contact(law)
        gap = contact.all_films(force)[-1]
        rate = float(contact.relaxation(gap, mpmath.mpf(force)))
    film = float(gap)
    scene: dict[str, Any] = {
        "law": name,
        "parameters": {symbol.name: float(numbers(law)[symbol]) for symbol in parameters_of(law)},
        "h": 1.02 * film,
        "force": force,
    }
    run = softdyn.simulate(**scene, until_t=25 / rate, times=[8 / rate, 10 / rate, 25 / rate])
    assert run.h[-1] == pytest.approx(film, rel=1e-8)  # exp(-25) of 2 %, and ten times rtol
    early, late = run.h[0] - film, run.h[1] - film
    # what is left of the distance makes the rate by exp(-8) of 2 % times the curvature, h/ell or so
    assert np.log(early / late) / 2 == pytest.approx(1.0, abs=1e-3)


# ----------------------------------------------------------------------------------------------------------- comparison


@pytest.mark.slow
def test_a_law_compared_with_itself_is_one() -> None:
    same = compare("rognon_gay", "rognon_gay", gaps=(1.0, 0.1), kappas=(1e-3,))
    assert same.zeta == same.delta == ((1.0, 1.0),)
    assert same.time == ((None, 1.0),)
    assert all(set(region.ratios.values()) == {"1"} for region in same.regions)
    assert [region.first for region in same.regions] == [region.second for region in same.regions]


@cache
def the_paper_and_equal_spheres() -> Any:
    return compare("rognon_gay", "equal_spheres", gaps=(1e2, 1.0, 1e-3, 1e-6), kappas=(1e-12, 1e-4))


@pytest.mark.slow
def test_exact_ratios_of_the_paper_to_equal_spheres() -> None:
    """The paper's friction is twice that of spheres far away, four times near contact; its alpha is 4/9."""
    regions = {region.first: region for region in the_paper_and_equal_spheres().regions}
    assert {name: region.second for name, region in regions.items()} == {
        x: x for x in ("Stokes", "Poiseuille", "Hertz")
    }
    softer = 4 * sqrt(2) / 9 / (Rational(4, 3) / (1 - nu**2))  # the law's stiffness over that of spheres, at one a
    expected = {
        "Stokes": {"zeta": 2, "dh_dt": HALF, "delta": Rational(3, 2) / softer},
        "Poiseuille": {"zeta": 4, "dh_dt": Rational(1, 4), "delta": Rational(3, 2) / softer},
        # at one force: friction as delta^2, 6 pi against 4 pi
        "Hertz": {"zeta": Rational(3, 2) * softer ** Rational(-4, 3), "delta": softer ** Rational(-2, 3)},
    }
    for region, ratios in expected.items():
        for quantity, ratio in ratios.items():
            found = parsed(regions[region].ratios[quantity])
            at = {nu: Rational(1, 3)}
            assert float((found / ratio).subs(at)) == pytest.approx(1, rel=1e-14), (region, quantity)


def parsed(text: str) -> Expr:
    from sympy import sympify

    return sympify(text, locals={"nu": nu})


@pytest.mark.slow
def test_the_table_tends_to_the_exact_ratios() -> None:
    """Far away, near contact, and flattened: corrections of R/h, h/R with its logarithm, and h/delta."""
    found = the_paper_and_equal_spheres()
    assert found.zeta[0][0] == pytest.approx(2, rel=0.02)
    assert found.zeta[0][2] == pytest.approx(4, rel=0.02)
    assert found.zeta[1][3] == pytest.approx(1.5 * (4 * np.sqrt(2) / 9 / (16 / 9)) ** (-4 / 3), rel=0.002)
    assert found.delta[0][0] == pytest.approx(1.5 / (4 * np.sqrt(2) / 9 / (16 / 9)), rel=1e-6)


@pytest.mark.slow
def test_times_compared_are_those_of_the_pair_engine() -> None:
    found = the_paper_and_equal_spheres()
    times = []
    for law in (rognon_gay, SPHERES):
        parameters = {symbol.name: float(numbers(law)[symbol]) for symbol in parameters_of(law)}
        run = softdyn.simulate(law=law.name, parameters=parameters, h=1e2, force=1e-4, until_h=1e-3, gaps=[1.0, 1e-3])
        times.append(run.t)
    np.testing.assert_allclose(found.time[1][1:3], times[0] / times[1], rtol=1e-7)


@pytest.mark.slow
def test_where_an_approach_ends_on_a_film_no_time_is_told() -> None:
    found = compare("equal_spheres", "dlvo", gaps=(1.0, 1e-1, 1e-4), kappas=(1e-4,))
    assert found.time[0][0] is None
    assert found.time[0][1] == pytest.approx(1, rel=1e-3)
    assert found.time[0][2] is None
    (reason,) = found.reasons
    assert "dlvo, kappa = 0.0001: under F=0.0001 the gap does not go" in reason


def test_the_text_of_a_comparison_holds_its_tables() -> None:
    text = comparison_text("rognon_gay", "rognon_gay")
    for title in ("friction zeta", "deflection delta", "time to approach, from h/R = 100", "exact ratios"):
        assert title in text


@pytest.mark.parametrize(
    ("gaps", "kappas", "message"),
    [((1.0,), (1e-3,), "two or more"), ((0.1, 1.0), (1e-3,), "falling"), ((1.0, 0.1), (-1e-3,), "positive")],
)
def test_a_plane_that_is_none_is_refused(gaps: Any, kappas: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        compare("rognon_gay", "rognon_gay", gaps=gaps, kappas=kappas)


def test_laws_that_mean_different_things_by_one_name_are_refused() -> None:
    from softdyn.derive import LENGTH

    other = Symbol("m", positive=True)
    clash = ContactLaw("clash", a=other + Abs(delta), F_ela=E * a * delta, zeta=eta * a, parameters={other: LENGTH})
    with pytest.raises(SceneError, match="the parameter m is a dimensionless in cone, and a length in clash"):
        compare("cone", clash)


def test_a_law_without_typical_values_is_compared_with_none() -> None:
    """Values made up would be told as typical ones."""
    bare = replace(LAWS["cone"], name="bare", typical={}, limits=())
    with pytest.raises(SceneError, match="law 'bare' gives no typical value of m"):
        compare("rognon_gay", bare)
