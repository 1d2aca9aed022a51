"""Drag is counted once: contacts carry what of a law's friction exceeds the drags of the particles by themselves."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import brenner
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy import Rational, Symbol, expand_log, log, pi, simplify, sqrt
from sympy.codegen.cfunctions import log1p

from softdyn.derive import DIMENSIONLESS, Drag, E, R, eta, h, size_ratio
from softdyn.derive.contact_equations import ContactNeeds
from softdyn.derive.contact_kernel import contact_ir
from softdyn.derive.emit import emit
from softdyn.derive.far_field import excess, far_friction, is_bounded, undeflected_friction
from softdyn.derive.laws.equal_spheres import law as equal_spheres
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.errors import LawError, SceneError
from softdyn.laws import stock_laws
from softdyn.particles.geometry import Wall
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.stress import two_spheres

STOKES = 6 * np.pi
#: Nearly rigid: the gap follows the push long before it has changed.
PARAMETERS = {"equal_spheres": {"E": 1e9, "eta": 1.0, "nu": 0.5}, "rognon_gay": {"E": 1e9, "eta": 1.0}}


def speeds(law: Any = "equal_spheres", **changes: Any) -> np.ndarray:
    """Velocities at the end of a short run."""
    settings: dict[str, Any] = {
        "law": law, "parameters": PARAMETERS.get(law, PARAMETERS["equal_spheres"]), "radii": 1.0, "drag": 1.0,
        "until_t": 1e-3, "times": 2, "rtol": 1e-6, **changes,
    }  # fmt: skip
    result = simulate_particles(ParticleScene(**settings))
    return np.asarray(result.v[-1])


def approaching(gap: float, ratio: float = 1.0, **changes: Any) -> float:
    """Friction of two spheres that are pushed together, force over the rate at which they approach.

    Over a run in which the gap closes by a thousandth.
    """
    pushes = [Push([0], [1.0, 0.0]), Push([1], [-1.0, 0.0])]
    R = 2 * ratio / (1 + ratio)
    until = 1e-3 * gap * 3 * np.pi * R * (1 + R / (2 * gap))
    x = [[0.0, 0.0], [1.0 + ratio + gap, 0.0]]
    v = speeds(**{"positions": x, "radii": [1.0, ratio], "push": pushes, "until_t": until, **changes})
    return 1.0 / float(v[0, 0] - v[1, 0])


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1e-3, 1e-2, 0.1, 0.5, 1.0, 3.0, 10.0, 30.0, 99.0])
def test_two_equal_spheres_approach_as_fast_as_in_brenners_series(gap: float) -> None:
    exact = 3 * np.pi * float(brenner.friction(gap))
    assert approaching(gap) == pytest.approx(exact, rel=0.01)


def settling(gap: float, radius: float = 1.0, **changes: Any) -> float:
    """Friction of a sphere that is pushed to a wall, force over speed, over that of Stokes."""
    until = 1e-3 * gap * STOKES * (radius + radius**2 / gap)
    v = speeds(**{
        "positions": [[0.0, gap + radius]], "radii": [radius], "wall": [Wall([0.0, 0.0], [0.0, -1.0])],
        "until_t": until, "push": [Push([0], [0.0, -1.0])], **changes,
    })  # fmt: skip
    return -1.0 / float(v[0, 1]) / (STOKES * radius)


GAPS = [1e-3, 1e-2, 0.1, 0.5, 1.0, 3.0, 10.0, 30.0, 99.0]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["equal_spheres", "droplet"])
@pytest.mark.parametrize(
    "gap", [pytest.param(gap, marks=() if gap in (0.1, 3.0) else pytest.mark.slow) for gap in GAPS]
)
def test_a_sphere_settles_on_a_wall_as_fast_as_in_brenners_solution(gap: float, law: str) -> None:
    parameters = {"sigma": 1e9, "eta": 1.0} if law == "droplet" else PARAMETERS[law]
    exact = two_spheres.friction(gap, math.inf)
    assert settling(gap, law=law, parameters=parameters) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("ratio", [1.2, 2.0, 5.0, 10.0, 40.0])
@pytest.mark.parametrize("gap", [gap if gap > 0.1 else pytest.param(gap, marks=pytest.mark.slow) for gap in GAPS])
def test_unequal_spheres_approach_as_fast_as_in_the_exact_solution(gap: float, ratio: float) -> None:
    """Free ones, under equal and opposite forces; the gap in smaller radii."""
    exact = 6 * np.pi * ratio / (1 + ratio) * two_spheres.friction(gap, ratio)
    assert approaching(gap, ratio) == pytest.approx(exact, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("gap", [1e-3, 0.1, 1.0])
def test_without_drag_the_contact_has_all_of_the_friction(gap: float) -> None:
    exact = two_spheres.friction(gap, math.inf)
    assert settling(gap, drag=0.0) == pytest.approx(exact, rel=0.01)
    exact = 4 * np.pi * two_spheres.friction(gap, 2.0)
    assert approaching(gap, 2.0, drag=0.0) == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("law", ["equal_spheres", "rognon_gay"])
@pytest.mark.parametrize("count", [2, 10, 64])
def test_distant_spheres_do_not_slow_one_that_is_pushed(law: str, count: int) -> None:
    """However many they are, and without a word of a range."""
    x = np.array([[100.0 * i, 100.0 * ((7 * i) % 11), 0.0] for i in range(count)])
    v = speeds(law, positions=x, push=[Push([0], [1.0, 0.0, 0.0])])
    assert v[0, 0] * STOKES == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("law", ["equal_spheres", "rognon_gay"])
@pytest.mark.parametrize("radius", [1.0, 0.1])
def test_a_sphere_far_from_a_wall_moves_as_stokes_says(law: str, radius: float) -> None:
    v = speeds(
        law, positions=[[0.0, 201.0 * radius], [500.0, 300.0]], radii=[radius, 1.0], until_t=1e-3 * radius**2,
        wall=[Wall([0.0, 0.0], [0.0, -1.0])], push=[Push([0], [0.0, -1.0])], range=200 * radius,
    )  # fmt: skip
    assert -v[0, 1] * STOKES * radius == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("drag", [1e-6, 0.5, 1.0])
@pytest.mark.parametrize("gap", [0.01, 1.0])
def test_with_less_drag_the_contact_carries_more_and_the_friction_of_two_is_the_same(drag: float, gap: float) -> None:
    assert approaching(gap, drag=drag) == pytest.approx(3 * np.pi * float(brenner.friction(gap)), rel=0.01)


@pytest.mark.slow
def test_more_drag_than_the_law_declares_adds_to_its_friction() -> None:
    """A contact never carries less than nothing."""
    assert approaching(195.0, drag=2.0) == pytest.approx(6 * np.pi, rel=0.01)
    mobile = replace(equal_spheres, name="mobile", drag=Drag(translation=4 * pi * eta * R))
    assert approaching(195.0, law=mobile) == pytest.approx(2 * np.pi, rel=0.01)


@pytest.mark.slow
@given(gap=st.floats(-3, 1).map(lambda x: 10**x), ratio=st.floats(0.1, 1.0))
@settings(max_examples=15, deadline=None)
def test_the_law_and_the_drags_make_the_friction_of_the_law(gap: float, ratio: float) -> None:
    """Of unequal spheres under equal and opposite forces: zeta of R and the size ratio, nothing twice."""
    radius, size = 2 * ratio / (1 + ratio), ratio / (1 + ratio) ** 2
    zeta = undeflected_friction(equal_spheres, unequal=True).subs({R: radius, eta: 1, h: gap, size_ratio: size})
    found = approaching(gap, ratio)
    assert found == pytest.approx(float(zeta), rel=5e-3)


@pytest.mark.parametrize("name", ["rognon_gay", "equal_spheres", "droplet", "dlvo", "steric", "soap_film", "cone"])
def test_what_is_left_of_a_stock_law_is_positive_and_vanishes(name: str) -> None:
    from importlib import import_module

    law = import_module(f"softdyn.derive.laws.{name}").law
    assert name in stock_laws()
    far, x = far_friction(law), excess(law)
    assert x is not None
    assert simplify(far / (pi * eta * R)) in (3, 6)
    plain = x.replace(log1p, lambda argument: log(1 + argument))
    assert simplify(expand_log(simplify(undeflected_friction(law) / far - 1 - plain), force=True)) == 0
    assert x.is_positive


@pytest.mark.slow
def test_without_drag_the_kernel_knows_nothing_of_it() -> None:
    with_drag, without = (emit(contact_ir(equal_spheres, ContactNeeds(drag=drag)), "c") for drag in (True, False))
    assert "excess" in with_drag
    assert "excess" not in without


def variant(name: str, zeta: Any, **more: Any) -> Any:
    return replace(rognon_gay, name=name, zeta=zeta, limits=(), **more)


@pytest.mark.slow
def test_a_law_that_holds_distant_particles_together_needs_a_range_with_drag() -> None:
    growing = variant("growing", 6 * pi * eta * R * (1 + R / h + h / R))
    assert not is_bounded(growing)
    spheres: dict[str, Any] = {
        "law": growing, "parameters": PARAMETERS["rognon_gay"], "positions": [[0.0, 0.0], [2.1, 0.0]],
        "push": [Push([0], [0.0, 1.0])],
    }  # fmt: skip
    with pytest.raises(SceneError, match="give contacts a range"):
        speeds(**spheres)
    speeds(**spheres, range=1.0)
    speeds(**{**spheres, "drag": 0.0, "push": [Push([0], [1e-3, 0.0]), Push([1], [-1e-3, 0.0])]})


def test_a_law_of_lubrication_alone_keeps_all_of_its_friction() -> None:
    lubrication = variant("lubrication", 6 * pi * eta * R**2 / h)
    assert far_friction(lubrication) == 0
    assert excess(lubrication) is None


def test_a_friction_below_what_it_is_far_away_is_refused_with_drag() -> None:
    dipping = variant("dipping", 6 * pi * eta * R * (1 + R / h) * (1 - 3 * R * h / (R + h) ** 2))
    assert far_friction(dipping) == 6 * pi * eta * R
    with pytest.raises(LawError, match="not above"):
        excess(dipping)


m = Symbol("m", positive=True)


@pytest.mark.parametrize(
    "zeta",
    [
        6 * pi * eta * R * sqrt(1 + R / h),
        6 * pi * eta * (R + m * R**2 / h),
        6 * pi * eta * R * (R + h) ** 2 / h**2,
        6 * pi * eta * R * (1 + log(1 + R / h) / 2),
    ],
)
def test_the_excess_of_any_law_is_found_to_rounding_however_far(zeta: Any) -> None:
    law = variant("any", zeta, parameters={m: DIMENSIONLESS}, typical={m: Rational(1, 2)})
    x = excess(law)
    assert x is not None
    import mpmath

    values = {R: 1, E: 1, eta: 1, m: Rational(1, 2)}
    for power in range(-6, 16, 3):
        with mpmath.workdps(50):
            exact = zeta.subs(values).subs(h, mpmath.mpf(10) ** power).evalf(50) / (6 * pi).evalf(50) - 1
        assert float(x.subs(values).subs(h, 10.0**power)) == pytest.approx(float(exact), rel=1e-11)
