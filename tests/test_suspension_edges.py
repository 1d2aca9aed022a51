"""Suspensions at the edges of what they may be: no grain, one, sizes of 1 to 10, packings, corners."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles import Bond, PairPotential
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate

#: What balances close to.
CLOSED = 1e-10
SIDES = ["left", "right", "bottom", "top"]
MORSE = [PairPotential("morse", {"De": 1.0, "b": 4.0, "d": 1.0}, cut_off=2.0)]
HERTZ: dict[str, Any] = {"law": "hertz", "parameters": {"E": 1e4, "nu": 0.3, "tau": 0.02}}
DROPLETS: dict[str, Any] = {"law": "droplet", "parameters": {"sigma": 5.0}, "gap": 0.02, "range": 0.05}
LOOSE: dict[str, Any] = {"potential": MORSE, "walls": []}
ENGINES = [HERTZ, DROPLETS, LOOSE]


def discs(**more: Any) -> SuspensionScene:
    given: dict[str, Any] = {
        "viscosity": 0.2, "density": 1.0, "elements": "P1-P1", "mesh": MeshSection(box=[6.0, 8.0], cells=[6, 8]),
        "boundary": [Boundary(SIDES, velocity=[0.0, 0.0])], "gravity": [0.0, -1.0], "radii": 0.5, "grain_density": 2.5,
        "positions": [], "walls": SIDES, "drag": "schiller_naumann", "width": 1.5, "until_t": 0.4, "dt": 0.2,
        "times": 2, "rtol": 1e-3,
    }  # fmt: skip
    return SuspensionScene(**{**given, **more})


def well(result: SuspensionResult) -> bool:
    """Whether all balances are closed, and nothing is warned of."""
    kinds = ("mass", "momentum", "volume", "exchange")
    return not result.warnings and all(float(result.arrays[f"{one}_imbalance"].max()) < CLOSED for one in kinds)


@pytest.fixture(scope="module")
def plain() -> SuspensionResult:
    """One grain that nothing but the fluid does anything to, in short steps."""
    return simulate(discs(positions=[[3.0, 4.0]], dt=0.0125, walls=[]))


@pytest.mark.parametrize("engine", ENGINES, ids=["dry", "films", "potentials"])
def test_no_grain_is_a_fluid_at_rest_and_one_falls_as_the_drag_lets_it(
    engine: dict[str, Any], plain: SuspensionResult
) -> None:
    """Whatever the grain could do to others, there are none: it falls alike, and walls feel nothing.

    All converge to one motion, those of first order from either side: in steps of 0.025 to 2 %.
    """
    none = simulate(discs(**engine))
    assert none.x.shape == (2, 0, 2)
    assert np.abs(none.u[-1]).max() < 1e-12
    assert all((none.arrays[name] == 0).all() for name in none.arrays if name.startswith("contact_"))
    one = simulate(discs(positions=[[3.0, 4.0]], dt=0.025, **engine))
    assert well(one)
    assert one.x[-1, 0, 1] - 4 == pytest.approx(plain.x[-1, 0, 1] - 4, rel=0.03)
    assert one.v[-1, 0, 1] == pytest.approx(plain.v[-1, 0, 1], rel=0.03)
    assert (one.contacts == 0).all()


@pytest.mark.parametrize("engine", [HERTZ, DROPLETS], ids=["dry", "films"])
def test_grains_of_one_to_ten_lose_no_volume(engine: dict[str, Any]) -> None:
    """A large disc above a layer of small ones, of a hundredth of its volume each."""
    small = [[float(x), float(y)] for x in np.arange(0.3, 5.8, 0.4) for y in (0.2, 0.6)]
    radii = [1.0] + [0.1] * len(small)
    result = simulate(discs(positions=[[3.0, 2.6], *small], radii=radii, width=3.0, **engine))
    assert well(result)
    assert result.grain_volume[-1] == pytest.approx(np.pi * (1 + 0.01 * len(small)), rel=1e-12)
    assert (result.x[-1, :, 1] > 0).all()


@pytest.mark.parametrize("engine", [HERTZ, DROPLETS], ids=["dry", "films"])
def test_a_packing_as_dense_as_it_gets_leaves_the_fluid_room(engine: dict[str, Any]) -> None:
    """Rows of discs next to one another, 0.87 of the volume between walls at most: the fluid has what is left."""
    rows = [[0.501 + 1.002 * k, 0.501 + 0.87 * row] for row in range(4) for k in range(5)]
    rows = [[x + 0.5 * (k // 5 % 2), y] for k, (x, y) in enumerate(rows)]
    result = simulate(discs(positions=rows, **engine))
    assert well(result)
    assert 0.05 < result.c[-1].min() < 0.4
    assert np.abs(result.v[-1]).max() < 0.2


@pytest.mark.parametrize("engine", [HERTZ, DROPLETS], ids=["dry", "films"])
def test_a_cluster_in_a_corner_is_kept_there(engine: dict[str, Any]) -> None:
    places = [[0.5, 0.5], [1.502, 0.5], [0.5, 1.502]]
    result = simulate(discs(positions=places, **engine))
    assert well(result)
    assert result.x[-1] == pytest.approx(np.array(places), abs=0.1)
    down = -result.contact_force_bottom[-1, 1]
    assert 0 < down < 2 * 3 * 0.6 * 2.5 * np.pi * 0.25


def test_what_cannot_be_is_refused_by_name() -> None:
    cases: list[tuple[SuspensionScene, type[Exception], str]] = [
        (discs(width=None, walls=[]), SceneError, "width is missing: without grains it does not follow"),
        (discs(bond=[Bond([[0, 1]], "hooke", {"k": 1.0, "d": 1.0})], walls=[]), SceneError, "there are no grains"),
        (discs(positions=[[7.0, 4.0], [9.0, 1.0]], walls=[]), SceneError, r"grain 0 is at \(7, 4\).* 1 more grains"),
        (discs(positions=[[3.0, 3.0], [3.1, 3.0]], **DROPLETS), SceneError, "particle 0 and particle 1 overlap by 0.9"),
        (discs(positions=[[3.0, 3.0], [3.1, 3.0]], **HERTZ), SceneError, "particle 0 and particle 1 overlap by 0.9"),
        (
            replace(discs(positions=[[3.0, 0.3]], **LOOSE), until_t=40.0, dt=2.0), IntegrationError,
            "grain 0 has left the mesh, .* give a contact law",
        ),
    ]  # fmt: skip
    for scene, error, words in cases:
        with pytest.raises(error, match=words):
            simulate(scene)
