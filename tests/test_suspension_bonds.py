"""Bonds and potentials between grains in a fluid: against exact motions, and what they leave alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import softdyn
from softdyn.errors import IntegrationError, SceneError
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles import Bond, Chains, PairPotential
from softdyn.results.rerun import differences
from softdyn.results.state_file import frames_beside
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.suspension_run import simulate_suspension

#: What balances close to.
CLOSED = 1e-12
SIDES = ["left", "right", "bottom", "top", "front", "back"]
#: Of spheres of this radius the other's flow, 3 R/(2 r) of the drag far from it, is within 4 % at the distances below.
RADIUS = 0.05
DRAG = 6 * math.pi * RADIUS


def dumbbell(**more: Any) -> SuspensionScene:
    """Two spheres that are bonded, in the middle of a box of 8^3, which follow the fluid within 6e-4."""
    given: dict[str, Any] = {
        "viscosity": 1.0, "density": 0.01, "elements": "P1-P1", "mesh": MeshSection(box=[8.0] * 3, cells=[6] * 3),
        "boundary": [Boundary(SIDES, velocity=[0.0] * 3)], "positions": [[2.5, 4.0, 4.0], [5.5, 4.0, 4.0]],
        "radii": RADIUS, "grain_density": 1.0, "bond": [Bond([[0, 1]], "hooke", {"k": 1.0, "d": 2.0})],
        "drag": "stokes", "width": 1.8, "until_t": 1.0, "dt": 0.05, "times": 6, "rtol": 1e-6,
    }  # fmt: skip
    return SuspensionScene(**{**given, **more})


def in_flow(flow: list[str], **more: Any) -> SuspensionScene:
    """The same in a flow that the walls make, and that is there from the start."""
    return dumbbell(**{"boundary": [Boundary(SIDES, velocity=flow)], "start": flow, **more})


def lengths(result: SuspensionResult) -> np.ndarray:
    return np.asarray(np.linalg.norm(result.x[:, 1] - result.x[:, 0], axis=1))


def closed(result: SuspensionResult) -> bool:
    kinds = ("mass", "momentum", "volume", "exchange")
    return all(float(result.arrays[f"{kind}_imbalance"].max()) < CLOSED for kind in kinds)


@pytest.mark.parametrize("potential", [pytest.param("hooke", marks=pytest.mark.slow), "fene"])
def test_a_dumbbell_relaxes_as_the_declared_drag_says(potential: str) -> None:
    """K dr/dt = 2 F(r): each end moves by F/K. Of FENE's spring the exact solution is by quadrature."""
    given = {"k": 1.0, "d": 2.0} | ({"Q": 1.2} if potential == "fene" else {})
    result = simulate(dumbbell(bond=[Bond([[0, 1]], potential, given)]))
    exact = solve_ivp(
        lambda _, x: -2 / DRAG * x / (1 - (x / 1.2) ** 2 if potential == "fene" else 1.0), (0, 1), [1.0],
        t_eval=result.t, rtol=1e-10, atol=1e-12,
    ).y[0]  # fmt: skip
    assert lengths(result) - 2 == pytest.approx(exact, rel=0.05)
    assert closed(result)
    assert not result.warnings
    assert result.bond_r[:, 0] == pytest.approx(lengths(result))
    # the grains have, to rounding, the momentum that the forces of the fluid give; bonds give none
    gained = np.diff(result.grain_momentum, axis=0, prepend=0.0)
    forces = (result.grain_drag + result.grain_pressure) * result.step_dt[:, None]
    assert np.abs(gained - forces).max() < 1e-12 * float(result.bond_tension.max()) * result.step_dt[0]


@pytest.mark.slow
def test_a_dumbbell_is_stretched_by_a_flow_as_its_spring_says() -> None:
    """In a flow (e x, -e y, 0) along it the ends are held back by K e r/2: FENE's force there, in a steady state."""
    rate, k, Q = 2.0, 1.0, 1.2
    spring = Bond([[0, 1]], "fene", {"k": k, "d": 2.0, "Q": Q})
    flow = [f"{rate}*(x - 4)", f"-{rate}*(y - 4)", "0"]
    result = simulate(
        in_flow(flow, bond=[spring], positions=[[2.9, 4.0, 4.0], [5.1, 4.0, 4.0]], until_t=2.0, dt=0.1, rtol=1e-4)
    )
    x = lengths(result)[-1] - 2
    force = k * x / (1 - (x / Q) ** 2)
    assert force == pytest.approx(DRAG * rate * (2 + x) / 2, rel=0.05)
    assert result.bond_tension[-1, 0] == pytest.approx(force)
    assert lengths(result)[-2] - 2 == pytest.approx(x, rel=1e-3)
    assert x > 0.7


@pytest.mark.slow
def test_a_dumbbell_tumbles_in_shear() -> None:
    """dr/dt = rate y - 2 F(r) n/K of the line between its ends: the exact solution is by quadrature.

    The rate is that at which spheres without the bond part: the filter tells 0.95 of the flow's, so near to walls.
    """
    k, Q, flow = 1.0, 1.2, ["2*(y - 4)", "0", "0"]
    start = np.array([-1.6, 1.2, 0.0])
    ends = [(4 - start / 2).tolist(), (4 + start / 2).tolist()]
    free = simulate(in_flow(flow, bond=[], positions=ends, until_t=0.05, dt=0.05))
    rate = float(np.ptp(free.v[-1, :, 0]) / start[1])
    assert rate == pytest.approx(2.0, rel=0.1)
    result = simulate(
        in_flow(flow, bond=[Bond([[0, 1]], "fene", {"k": k, "d": 2.0, "Q": Q})], positions=ends, until_t=2.0, rtol=1e-4)
    )

    def motion(_: float, r: np.ndarray) -> np.ndarray:
        size = float(np.linalg.norm(r))
        x = size - 2
        return np.array([rate * r[1], 0.0, 0.0]) - 2 / DRAG * k * x / (1 - (x / Q) ** 2) * r / size

    exact = solve_ivp(motion, (0, 2), start, t_eval=result.t, rtol=1e-10, atol=1e-12).y.T
    found = result.x[:, 1] - result.x[:, 0]
    assert np.abs(found - exact).max() < 0.05 * 2
    assert found[0, 0] < -1.5
    assert found[-1, 0] > 1.5  # it has turned over


@pytest.mark.slow
def test_bonds_break_and_are_told_and_resumed_to_the_bit(tmp_path: Path) -> None:
    """Three bonds break in a flow that pulls, the middle one first; a run that is killed between goes on as it was."""
    bonds = Bond([[0, 1], [1, 2], [2, 3]], "hooke", {"k": 1.0, "d": 0.8}, breaks_at_length=1.1)
    scene = in_flow(
        ["2*(x - 4)", "-2*(y - 4)", "0"], bond=[bonds], until_t=0.2, rtol=1e-4,
        positions=[[2.6, 4.0, 4.0], [3.5, 4.0, 4.0], [4.5, 4.0, 4.0], [5.4, 4.0, 4.0]],
        potential=[PairPotential("morse", {"De": 0.1, "b": 4.0, "d": 0.5}, cut_off=1.5)],
    )  # fmt: skip
    whole, checkpoint = simulate(scene), tmp_path / "run.checkpoint.npz"
    first, last = whole.bond_broken[1], whole.bond_broken[[0, 2]]
    assert first < 0.1 < last.min() <= last.max() < 0.2
    assert last[0] == pytest.approx(last[1], rel=1e-6)
    assert (whole.bond_tension[-1] == 0).all()
    assert closed(whole)

    def stop(t: float, *_: Any) -> None:
        if t > 0.09:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_suspension(scene, stop, checkpoint)
    # frames alone do not say which have broken
    assert "told as if none had broken" in softdyn.load_result(frames_beside(checkpoint)).warnings[1]
    assert not differences(whole, simulate_suspension(scene, None, checkpoint, resume=True))
    saved = whole.save(tmp_path / "run.npz")
    assert not differences(whole, softdyn.simulate(softdyn.scene_of(softdyn.load_result(saved))))


def test_a_potential_that_shear_switches_on_sees_the_rate_where_the_grains_are() -> None:
    """In Couette's flow of the rate 2 the platelets' well has 0.8 of the depth in a fast one; at rest there is none.

    The activation is that of old contacts, whose age is many times that in which they mature.
    """
    well = PairPotential("platelet", {"De": 1.0, "b": 3.0, "d": 1.0, "tau": 1e-3, "threshold": 1.0}, cut_off=2.0)
    pulls = []
    for rate in (2.0, 0.0):
        result = simulate(
            in_flow(
                [f"{rate}*(y - 4)", "0", "0"], bond=[], potential=[well], until_t=0.02, dt=0.005,
                positions=[[4.0, 4.0, 3.4], [4.0, 4.0, 4.6]],
            )
        )  # fmt: skip
        pulls.append(-result.drag[-1, 0, 2])
    r, cut = 1.2, 2.0
    force = [6 * (math.exp(-3 * (s - 1)) - math.exp(-6 * (s - 1))) for s in (r, cut)]
    assert pulls[0] == pytest.approx(0.8 * (force[0] - force[1]), rel=0.06)
    assert abs(pulls[1]) < 1e-12


def test_chains_are_placed_between_the_walls_of_a_mesh() -> None:
    scene = SuspensionScene(
        viscosity=1.0, density=1.0, elements="P1-P1",
        mesh=MeshSection(box=[12.0, 8.0], cells=[9, 6], origin=[-3.0, 1.0]),
        boundary=[Boundary(["left", "right"], periodic=True), Boundary(["bottom", "top"], velocity=[0.0, 0.0])],
        chains=Chains(count=3, beads=6, radius=0.3, spacing=0.7, seed=2), grain_density=5.0, gravity=[0.1, 0.0],
        bond=[Bond("chains", "fene", {"k": 50.0, "Q": 0.2, "d": 0.65})], law="hertz", walls=["bottom", "top"],
        parameters={"E": 1e3, "nu": 0.3, "tau": 0.01}, drag="schiller_naumann", width=1.4, until_t=1.0, dt=0.25,
        times=3, rtol=1e-4,
    )  # fmt: skip
    result = simulate(scene)
    assert result.x.shape == (3, 18, 2)
    assert (result.x[0, :, 1] >= 1.3).all()
    assert (result.x[0, :, 1] <= 8.7).all()
    assert len(result.bond_i) == 15
    assert result.bond_r[0] == pytest.approx(0.7)
    assert closed(result)
    assert not result.warnings
    assert "contact_force_top" in result.arrays


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bond": [Bond([[0, 2]], "hooke", {"k": 1.0, "d": 2.0})]}, "there is no particle 2"),
        ({"bond": [Bond([[0, 1]], "fene", {"k": 1.0, "d": 2.0, "Q": 0.9})]}, "3 apart at the start, beyond"),
        ({"held": True}, r"\[\[bond\]\] is of no use to grains that are held"),
        ({"chains": Chains(2, 3, 0.1, 0.3, 1)}, r"\[particles\] positions and \[chains\] are two ways"),
        (
            {"positions": (), "radii": None, "chains": Chains(2, 3, 0.1, 0.3, 1, box=[8.0] * 3)},
            r"\[chains\] box follows from the mesh",
        ),
        ({"bond": [Bond("chains", "hooke", {"k": 1.0, "d": 2.0})]}, "are those of chains that are generated"),
        (
            {"law": "hertz", "parameters": {"E": 1e3, "nu": 0.3, "tau": 0.01}, "range": 0.3},
            r"\[contacts\] range: contacts of this law end where surfaces part",
        ),
        (
            {"potential": [PairPotential("morse", {"De": 1.0, "b": 1.0, "d": 1.0}, between=["a", "b"])]},
            "there is no species 'a'",
        ),
    ],
)  # fmt: skip
def test_bad_bonds_are_refused_by_name(change: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        simulate(dumbbell(**change))


def test_a_spring_that_would_be_torn_ends_the_run_by_name() -> None:
    """A flow that pulls 1e18 times as hard as FENE's spring: its length is within rounding of the largest."""
    flow = ["1e18*(x - 4)", "-1e18*(y - 4)", "0"]
    with pytest.raises(IntegrationError, match="particles 0 and 1") as caught:
        simulate(
            in_flow(flow, until_t=1e-16, dt=1e-17, bond=[Bond([[0, 1]], "fene", {"k": 1.0, "d": 2.0, "Q": 1.0001})])
        )
    assert len(caught.value.partial) >= 1
