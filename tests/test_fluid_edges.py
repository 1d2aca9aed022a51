"""Flows at the edge of what can be asked for: each is right, or an error that names the cause."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from softdyn.errors import SceneError
from softdyn.fluid import Bed, Boundary, FluidScene, MeshSection, simulate

WALLS = Boundary(["bottom", "top"], slip=True)
ENDS = [Boundary("left", velocity=[1.0, 0.0]), Boundary("right", pressure=0.0)]
ELEMENTS = ["P2-P1", "P1-P1"]


def channel(**more: Any) -> FluidScene:
    """A channel of 12 x 4 cells in which the fluid flows evenly."""
    given: dict[str, Any] = {
        "viscosity": 1.0,
        "density": 1.0,
        "mesh": MeshSection(box=[3.0, 1.0], cells=[12, 4]),
        "boundary": [*ENDS, WALLS],
        "steady": True,
    }
    return FluidScene(**(given | more))


@pytest.mark.slow
@pytest.mark.parametrize("elements", ELEMENTS)
def test_a_bed_without_grains_is_no_bed(elements: str) -> None:
    """A porosity of exactly 1, with a drag: the flow is that of the fluid alone."""
    lid = [Boundary("top", velocity=[1.0, 0.0]), Boundary(["left", "right", "bottom"], velocity=[0.0, 0.0])]
    scene = channel(boundary=lid, elements=elements)
    alone = simulate(scene)
    among = simulate(channel(boundary=lid, elements=elements, bed=Bed(1.0, drag="ergun", radius=0.01)))
    assert among.u == pytest.approx(alone.u, abs=1e-10)
    assert among.bed_force == pytest.approx(0, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("elements", ["P2-P1", pytest.param("P1-P1", marks=pytest.mark.slow)])
def test_a_porosity_below_all_packings_is_clamped_with_a_warning(elements: str) -> None:
    low = simulate(channel(elements=elements, bed=Bed(0.01, drag="dallavalle_di_felice", radius=0.01)))
    least = simulate(channel(elements=elements, bed=Bed(0.05, drag="dallavalle_di_felice", radius=0.01)))
    assert any("is below 0.05 at" in warning and "taken for 0.05" in warning for warning in low.warnings)
    assert not least.warnings
    assert (low.c == 0.05).all()
    assert low.p == pytest.approx(least.p)


@pytest.mark.slow
@pytest.mark.parametrize("elements", ELEMENTS)
def test_grains_that_move_with_the_fluid_feel_nothing_of_it(elements: str) -> None:
    """A slip of exactly 0: porosity times velocity is 0.6 where velocities are 1, and there is no pressure."""
    bed = Bed(0.6, drag="dallavalle_di_felice", radius=0.01, velocity=[1.0, 0.0])
    result = simulate(channel(elements=elements, bed=bed))
    assert result.u[-1] == pytest.approx(np.tile([0.6, 0.0], (result.u.shape[1], 1)), abs=1e-10)
    assert np.ptp(result.p[-1]) == pytest.approx(0, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("elements", ELEMENTS)
def test_fluid_that_flows_into_a_box_without_an_exit_is_refused(elements: str) -> None:
    scene = channel(elements=elements, boundary=[ENDS[0], Boundary(["right", "bottom", "top"], velocity=[0.0, 0.0])])
    with pytest.raises(SceneError, match=r"would take in 1 and give off 0 at t = 0, .* give one of them a pressure"):
        simulate(scene)


@pytest.mark.slow
def test_a_wall_of_dense_grains_across_the_channel_lets_through_what_it_must() -> None:
    """The densest that there can be, four cells thick: all of the fluid goes through it, at a great pressure."""
    wall = "1 - 0.95*smoothstep(x, 0.9, 1.2)*(1 - smoothstep(x, 1.8, 2.1))"
    scene = channel(
        viscosity=1e-3, mesh=MeshSection(box=[3.0, 1.0], cells=[48, 4]),
        bed=Bed(wall, drag="dallavalle_di_felice", radius=0.01),
    )  # fmt: skip
    result = simulate(scene)
    assert result.flux_right[-1] == pytest.approx(1, rel=1e-9)
    assert result.p[-1][result.p_at[:, 0] == 0].min() > 1e4
    assert result.mass_imbalance.max() < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("elements", ELEMENTS)
def test_a_box_closed_by_walls_is_at_rest_under_any_force_with_a_potential(elements: str) -> None:
    """Cells with no exit: the pressure takes all of the force, and no fluid moves."""
    walls = Boundary(["left", "right", "bottom", "top"], velocity=[0.0, 0.0])
    result = simulate(channel(elements=elements, boundary=[walls], force=[2.0, -3.0]))
    assert np.abs(result.u).max() < 1e-12
    expected = result.p_at @ [2.0, -3.0]
    assert result.p[-1] - result.p[-1].mean() == pytest.approx(expected - expected.mean(), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_no_scale_of_the_viscosity_matters_to_a_creeping_flow(factor: float) -> None:
    walls = [*ENDS, Boundary(["bottom", "top"], velocity=[0.0, 0.0])]
    one = simulate(channel(boundary=walls, density=0.0))
    other = simulate(channel(boundary=walls, density=0.0, viscosity=factor))
    assert other.u == pytest.approx(one.u, abs=1e-9)
    assert other.p / factor == pytest.approx(one.p, rel=1e-6, abs=1e-6 * np.abs(one.p).max())


@pytest.mark.parametrize(
    ("boundary", "said"),
    [
        ([*ENDS], "nothing is said of boundary 'bottom', 'top'"),
        ([*ENDS, WALLS, Boundary("inlet", slip=True)], "the mesh has no boundary 'inlet'"),
        ([*ENDS, WALLS, Boundary("top", velocity=[0, 0])], "boundary 'top' has a condition already"),
    ],
)
def test_boundaries_that_do_not_fit_are_told_before_anything_runs(boundary: list[Boundary], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        simulate(channel(boundary=boundary))
