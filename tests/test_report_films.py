"""Laws against elastohydrodynamics in their reports: the laws' own values, the reference's, and where both belong."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import Any

import elastohydrodynamics as ehd
import mpmath
import numpy as np
import pytest
from sympy import S, Symbol, sqrt
from test_laws import LAWS, of_state

from softdyn.derive import LENGTH, ContactLaw, R, delta, eta, h
from softdyn.derive.laws import hertz_dry, lubrication_rigid
from softdyn.derive.laws.rognon_gay import law as rognon_gay
from softdyn.study import elastohydrodynamics as study
from softdyn.study.law_page import film

KEPT = json.loads(ehd.TABLE.read_text(encoding="utf-8"))
ROWS = np.array(KEPT["rows"])
SPHERES = LAWS["equal_spheres"]
#: An h/R far from that of the figure.
GAP = mpmath.mpf("1e-14")


@cache
def lines(law: ContactLaw) -> list[dict[str, Any]]:
    """What each panel of the figure shows, by its labels."""
    return [{line.get_label(): np.array(line.get_data()) for line in axes.lines} for axes in study.draw(law).axes]


def exact(law: ContactLaw, quantity: Any, x: float) -> mpmath.mpf:
    with mpmath.workdps(40):
        return of_state(law, quantity)(GAP, GAP * mpmath.mpf(x) / 2)


@pytest.mark.slow
@pytest.mark.parametrize("law", [SPHERES, LAWS["droplet"], rognon_gay], ids=lambda law: law.name)
def test_curves_are_those_of_the_law(law: ContactLaw) -> None:
    """Friction over its own at delta = 0, and F/delta over its limit, by other digits and at another gap."""
    panels = lines(law)
    x, values = panels[0][law.name][:, ::37]
    for state, value in zip(x, values, strict=True):
        assert value == pytest.approx(float(exact(law, law.zeta, state) / exact(law, law.zeta, 0)), rel=1e-6)
    assert x.min() < -7
    assert x.max() > 12
    assert study.is_half_space(law) == (len(panels) == 3) == (law.name != "droplet")
    if len(panels) == 3:
        x, values = panels[1][law.name][:, ::37]
        for state, value in zip(x, values, strict=True):
            ratio = exact(law, law.F_ela / delta, state) / exact(law, law.F_ela / delta, 1e-15)
            assert value == pytest.approx(float(ratio), rel=1e-5)


def test_points_are_those_of_the_reference() -> None:
    friction, radius, gaps = lines(SPHERES)
    np.testing.assert_array_equal(friction["elastohydrodynamics"], ROWS[:, :2].T)
    # 2 sqrt(2) at delta = 0, which test_pulled_films holds the reference against
    np.testing.assert_allclose(radius["elastohydrodynamics"][1], ROWS[:, 2] / np.sqrt(8), rtol=0.005)
    nearer = np.hstack([friction[f"pulled from {name} the gap"] for name in ("half", "twice")])
    np.testing.assert_array_equal(nearer, np.array(KEPT["pulled from nearer"]["rows"])[:, 1:].T)
    kept = KEPT["reversed"]
    for name, label in (("centre", "reference, centre"), ("smallest", "reference, smallest")):
        np.testing.assert_allclose(gaps[label], [kept["t"], np.array(kept[name]) / kept["centre"][0]])


def test_the_law_opens_at_once_where_the_centre_of_a_film_goes_on_closing() -> None:
    _, _, gaps = lines(SPHERES)
    centre, (t, gap) = gaps["reference, centre"], gaps["equal_spheres"]
    kept = KEPT["reversed"]
    force = np.interp(t, kept["t"], kept["force"])
    assert abs(force[gap.argmin()]) < 0.3, "it closes while it is pressed, and opens while it is pulled"
    assert gap[-1] == pytest.approx(kept["centre"][-1] / kept["centre"][0], rel=1e-3)
    assert centre[1].min() < 0.6
    assert centre[0][centre[1].argmin()] > 4 * t[-1]


def test_the_law_goes_through_the_forces_of_the_reference() -> None:
    """dh/dt = -F/zeta, in the solver's units: 6 pi/h times the law's friction at the deflection that carries F."""
    _, _, gaps = lines(SPHERES)
    t, gap = gaps["equal_spheres"]
    kept = KEPT["reversed"]
    carried = of_state(SPHERES, SPHERES.F_ela)
    for k in (len(t) // 2, len(t) - 10):
        force = np.interp(t[k], kept["t"], kept["force"])
        with mpmath.workdps(40):
            start = carried(GAP, GAP * kept["deflection"][0] / kept["centre"][0] / 2)
            h_ = GAP * mpmath.mpf(gap[k])
            x = mpmath.findroot(lambda x: carried(h_, h_ * x / 2) / start - force, (-10, -0.01), solver="anderson")  # noqa: B023
        friction = exact(SPHERES, SPHERES.zeta, x) / exact(SPHERES, SPHERES.zeta, 0)
        rate = np.gradient(np.log(gap), t)[k]
        assert rate == pytest.approx(float(-force / (6 * mpmath.pi * friction)), rel=0.02)


def test_the_deviation_told_is_that_of_the_figure() -> None:
    for law in (SPHERES, LAWS["droplet"]):
        drawn = lines(law)[0]
        inside = ROWS[(ROWS[:, 0] >= -5) & (ROWS[:, 0] <= 3)]
        ratio = np.interp(inside[:, 0], *drawn[law.name]) / inside[:, 1]
        assert study.deviation(law) == pytest.approx(max(ratio.max(), 1 / ratio.min()), abs=0.005)
        assert study.deviation(law) < 1 + study.BAND
    assert study.deviation(rognon_gay) > 10, "pulled, its film widens"


@pytest.mark.parametrize("law", [*LAWS.values(), rognon_gay], ids=lambda law: law.name)
def test_round_surfaces_have_the_figure(law: ContactLaw) -> None:
    assert study.applies(law)


def test_other_laws_have_none() -> None:
    """Rigid and dry ones; films whose rigid friction is not that of round surfaces; a law of unknown lengths."""
    slip = Symbol("slip", positive=True)
    droplet = LAWS["droplet"]
    others = [
        lubrication_rigid.law,
        hertz_dry.law,
        replace(droplet, zeta=6 * eta * R**4 / h**3, limits=()),
        replace(droplet, zeta=6 * eta * R * sqrt(R / h), limits=()),
        replace(droplet, zeta=S(6) * eta * R, limits=()),
        replace(droplet, zeta=6 * eta * R**2 / (h + slip), parameters={**droplet.parameters, slip: LENGTH}, limits=()),
    ]
    for law in others:
        assert film(law) is None
    known = replace(others[-1], typical={**droplet.typical, slip: R / 1000})
    assert film(known) is None, "with slip, friction at contact does not diverge as 1/h"
