"""Potentials and bonds between particles: against quadrature and exact solutions, their energies, and refusals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.special import lambertw

from softdyn import load_result
from softdyn.errors import IntegrationError, SceneError
from softdyn.particles.chains import Chains, chain_pairs, placed_chains
from softdyn.particles.files import read_particle_scene
from softdyn.particles.free_plots import bonds_at
from softdyn.particles.mechanisms.bonds import Bond
from softdyn.particles.mechanisms.inertia import Inertia
from softdyn.particles.mechanisms.potentials import PairPotential
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.particle_scene import check
from softdyn.results.rerun import differences

#: Drag of a particle of radius 1 is 1.
UNIT: dict[str, Any] = {"parameters": {"eta": 1 / (6 * math.pi)}, "drag": 1.0, "radii": 1.0, "times": 2}
MORSE = PairPotential("morse", {"De": 1.0, "b": 2.0, "d": 2.0})
HOOKE: dict[str, Any] = {"pairs": [[0, 1]], "potential": "hooke", "parameters": {"k": 1.0, "d": 2.0}}
FENE: dict[str, Any] = {"pairs": [[0, 1]], "potential": "fene", "parameters": {"k": 1.0, "Q": 1.0, "d": 2.0}}


def pair(apart: float, **more: Any) -> ParticleScene:
    """Two particles on the x axis, and what acts between them."""
    return ParticleScene(**{**UNIT, "positions": [[0.0, 0.0], [apart, 0.0]], "until_t": 1.0, **more})


def distance(result: Any, frame: int = -1) -> float:
    return float(np.linalg.norm(result.x[frame, 1] - result.x[frame, 0]))


# against quadrature


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "start", "end", "energy"),
    [
        ({"potential": [MORSE], "rtol": 1e-9}, 2.5, 0.05, lambda r: (1 - mpmath.exp(-2 * (r - 2))) ** 2),
        ({"bond": [Bond(**FENE)], "rtol": 1e-10}, 2.9, 0.02, lambda r: -mpmath.log(1 - (r - 2) ** 2) / 2),
    ],
)
def test_a_pair_relaxes_as_quadrature_says_and_drag_takes_what_was_stored(given, start, end, energy) -> None:
    """dr/dt = -2 U'(r): the time from one distance to the other is the integral of dr/(-2 U'), to 1e-8."""
    result = simulate_particles(pair(start, until_t=end, **given))
    reached = distance(result)
    time = mpmath.quad(lambda r: -1 / (2 * mpmath.diff(energy, r)), [start, (start + reached) / 2, reached])
    assert float(time) == pytest.approx(end, rel=1e-8)
    lost = float(energy(start) - energy(reached))
    assert result.energy["drag"] == pytest.approx(lost, rel=1e-8)
    assert result.energy["stored"] == pytest.approx(-lost, rel=1e-8)
    assert abs(result.energy["imbalance"]) < 1e-8
    # action and reaction
    np.testing.assert_allclose(result.x[-1].mean(axis=0), [start / 2, 0.0], atol=1e-12)


@pytest.mark.slow
def test_a_morse_pair_follows_its_closed_form() -> None:
    """U = exp(b (r - d)) obeys u + ln(u - 1) = C - 4 De b^2 t/Z, which Lambert's W solves; error goes with rtol."""
    u = math.exp(2 * 0.5)
    exact = 2 + math.log(1 + lambertw((u - 1) * math.exp(u - 1 - 16 * 0.2)).real) / 2
    off = []
    for rtol in (1e-5, 1e-8):
        result = simulate_particles(pair(2.5, until_t=0.2, rtol=rtol, potential=[MORSE]))
        off.append(abs(distance(result) - exact))
    assert off[0] < 1e-4
    assert off[1] < 1e-7
    assert off[1] < off[0] / 50


@pytest.mark.slow
def test_a_dumbbell_in_shear_is_stretched_and_turned_as_the_exact_solution() -> None:
    """Hooke without length at rest: x = (x0 + rate y0 t) exp(-2kt/Z), y = y0 exp(-2kt/Z)."""
    bond = Bond([[0, 1]], "hooke", {"k": 0.1, "d": 0.0})
    result = simulate_particles(
        ParticleScene(**UNIT, positions=[[0.0, -1.5], [0.4, 1.5]], bond=[bond], shear_rate=2.0, until_t=2.0, rtol=1e-8)
    )
    fades = math.exp(-0.4)
    np.testing.assert_allclose(result.x[-1, 1] - result.x[-1, 0], [(0.4 + 2 * 3 * 2) * fades, 3 * fades], rtol=1e-6)
    assert abs(result.energy["imbalance"]) < 1e-6


def test_a_pulled_fene_bond_stops_where_its_force_is_the_pull() -> None:
    """K x/(1 - (x/Q)^2) = f has one root below Q, however large f is."""
    pull = [Push([0], [-50.0, 0.0]), Push([1], [50.0, 0.0])]
    result = simulate_particles(pair(2.1, bond=[Bond(**FENE)], push=pull, rtol=1e-4))
    x = (-1 + math.sqrt(1 + 4 * 50**2)) / (2 * 50)
    assert distance(result) - 2 == pytest.approx(x, rel=1e-6)
    assert result.bond_tension[-1, 0] == pytest.approx(50.0, rel=1e-3)


# breaking


@pytest.mark.parametrize("limit", [{"breaks_at_length": 2.5}, {"breaks_at_force": 0.5}])
def test_a_bond_breaks_when_and_where_it_should(limit: dict[str, float]) -> None:
    """Pulled with f = 1: at t = -ln(1 - x/f)/2 for x = 0.5; from then on both go free, and k x^2/2 is lost."""
    pull = [Push([0], [-1.0, 0.0]), Push([1], [1.0, 0.0])]
    result = simulate_particles(pair(2.0, bond=[Bond(**HOOKE, **limit)], push=pull, rtol=1e-8, until_t=0.5, times=21))
    breaks = math.log(2) / 2
    assert result.bond_broken[0] == pytest.approx(breaks, rel=1e-7)
    assert distance(result) == pytest.approx(2.5 + 2 * (0.5 - breaks), rel=1e-7)
    assert result.energy["broken"] == pytest.approx(0.125, rel=1e-7)
    assert result.energy["stored"] == 0.0
    assert abs(result.energy["imbalance"]) < 1e-7
    held = result.t < breaks
    np.testing.assert_allclose(result.bond_tension[:, 0], np.where(held, result.bond_r[:, 0] - 2, 0.0), atol=1e-12)
    assert result.stats["bonds_broken"] == 1


@pytest.mark.slow
def test_runs_with_broken_bonds_and_ages_resume_to_the_bit(tmp_path: Path) -> None:
    """What has broken, and since when pairs are near, is in the checkpoint."""
    sticky = PairPotential("platelet", {"De": 1.0, "b": 2.0, "d": 2.0, "tau": 0.3, "threshold": 0.1}, cut_off=3.5)
    scene = ParticleScene(
        **{**UNIT, "times": 4}, positions=[[0.0, 0.0], [2.2, 0.5], [0.5, 3.0]], potential=[sticky], shear_rate=2.0,
        bond=[Bond(**HOOKE, breaks_at_length=2.4)], until_t=1.0, rtol=1e-4,
        push=[Push([0], [-3.0, 0.0]), Push([1], [3.0, 0.0])],
    )  # fmt: skip
    whole = simulate_particles(scene)
    assert 0 < whole.bond_broken[0] < 1.0
    file, steps = tmp_path / "run.checkpoint.npz", []

    def stop(_t: float, _steps: int, _iterations: int) -> None:
        steps.append(_t)
        if len(steps) % 7 == 0:
            raise KeyboardInterrupt

    resumed = None
    for _ in range(100):
        try:
            resumed = simulate_particles(scene, stop, file, resume=True)
            break
        except KeyboardInterrupt:
            # frames alone do not say which have broken
            assert "told as if none had broken" in load_result(tmp_path / "run.frames").warnings[1]
    assert resumed is not None
    assert differences(whole, resumed) == {}
    assert resumed.energy == whole.energy


# potentials


def test_energy_and_force_end_at_the_cut_off_without_a_jump() -> None:
    """Drawn out of the well by a steady pull: no step fails there, and no energy is missing."""
    short = PairPotential("morse", MORSE.parameters, cut_off=2.5)
    pull = [Push([0], [-2.0, 0.0]), Push([1], [2.0, 0.0])]
    result = simulate_particles(pair(2.0, potential=[short], push=pull, until_t=0.5, rtol=1e-7, times=51))
    assert distance(result) > 2.6
    beyond = np.array([distance(result, k) >= 2.5 for k in range(51)])
    assert (result.potential_energy[beyond] == 0).all()
    # U(2) - U(2.5) - 0.5 F(2.5)
    e = math.exp(-1.0)
    assert result.potential_energy[0] == pytest.approx(-((1 - e) ** 2) + 0.5 * 4 * e * (1 - e), rel=1e-12)
    assert abs(result.energy["imbalance"]) < 1e-5


def test_potentials_act_between_the_species_that_are_named() -> None:
    given = PairPotential("morse", MORSE.parameters, cut_off=3.5, between=["a", "b"])
    result = simulate_particles(
        ParticleScene(
            **UNIT,
            positions=[[0.0], [2.5], [5.0], [7.5]],
            species=["a", "b", "b", "a"],
            potential=[given],
            until_t=0.02,
            rtol=1e-6,
        )
    )
    moved = result.x[-1, :, 0] - result.x[0, :, 0]
    assert moved[0] == pytest.approx(-moved[1], rel=1e-9)
    assert moved[0] == pytest.approx(moved[2], rel=1e-9)
    assert moved[0] > 1e-3


def test_a_periodic_box_changes_nothing_but_adds_a_stress() -> None:
    """Across its face as within it; the stress of one pair is -F r/V along it."""
    near = PairPotential("morse", MORSE.parameters, cut_off=3.0)
    given = {**UNIT, "bond": [Bond(**HOOKE)], "potential": [near], "until_t": 0.02, "rtol": 1e-6}
    free = simulate_particles(ParticleScene(**given, positions=[[0.0, 0.0], [2.3, 0.0]]))
    boxed = simulate_particles(ParticleScene(**given, positions=[[19.0, 5.0], [1.3, 5.0]], box=[20.0, 20.0]))
    moved = [result.x[-1] - result.x[0] for result in (free, boxed)]
    np.testing.assert_allclose(moved[1], moved[0], atol=1e-9)
    r = 2.3
    e, cut = (math.exp(-2 * (x - 2)) for x in (r, 3.0))
    F = -(r - 2) - 4 * e * (1 - e) + 4 * cut * (1 - cut)
    np.testing.assert_allclose(boxed.stress[0], [[-F * r / (20 * 20 * 2), 0], [0, 0]], atol=1e-12)


def test_what_activation_gives_is_in_the_balance() -> None:
    """Two that are held at a distance: the well grows as 1 - exp(-t/tau), and its energy is given by the activation."""
    sticky = PairPotential("platelet", {"De": 1.0, "b": 2.0, "d": 2.0, "tau": 0.3, "threshold": 1.0}, cut_off=4.0)
    result = simulate_particles(
        pair(2.2, potential=[sticky], hold=[Hold("all", "xy")], shear_rate=2.0, until_t=1.0, rtol=1e-6)
    )
    x, c = math.exp(-2 * 0.2), math.exp(-2 * 2.0)
    F_cut = 4 * (c**2 - c)
    well = (x**2 - 2 * x) - (c**2 - 2 * c) + (2.2 - 4.0) * F_cut
    grown = (1 - math.exp(-1 / 0.3)) * 0.8
    assert result.energy["stored"] == pytest.approx(well * grown, rel=1e-9)
    # nothing moves, so that steps are long: what they miss is told as the error of the energy
    assert result.energy["activation"] == pytest.approx(well * grown, rel=1e-2)
    assert result.stats["energy_error"] == pytest.approx(result.energy["imbalance"], rel=1e-9)


def test_a_shear_rate_that_rises_switches_cohesion_on() -> None:
    """With a rate that is given in time the balance holds, too."""
    sticky = PairPotential("platelet", {"De": 2.0, "b": 2.0, "d": 2.0, "tau": 0.1, "threshold": 0.5}, cut_off=4.0)
    scene = pair(2.4, potential=[sticky], shear_rate="0.2*t**2", until_t=2.0, rtol=1e-6, times=3)
    result = simulate_particles(scene)
    assert abs(result.energy["imbalance"]) < 1e-5
    assert distance(result, 1) > distance(result, 2)
    assert result.energy["activation"] < 0


# chains


@pytest.mark.parametrize("ring", [False, True])
def test_chains_are_spaced_apart_from_one_another_and_the_same_for_a_seed(ring: bool) -> None:
    given = Chains(count=6, beads=8, radius=1.0, spacing=2.1, box=[30.0, 30.0, 30.0], seed=4, ring=ring)
    x, pairs = placed_chains(given)
    assert np.array_equal(x, placed_chains(given)[0])
    assert len(pairs) == 6 * (8 if ring else 7)
    np.testing.assert_allclose(np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1), 2.1, rtol=1e-12)
    away = x[:, None] - x[None]
    away -= 30 * np.round(away / 30)
    r = np.linalg.norm(away, axis=2)[np.triu_indices(len(x), 1)]
    assert r.min() > 0.9 * 2.1 - 1e-12


def test_a_scene_of_chains_is_read_bonded_and_checked(tmp_path: Path) -> None:
    file = tmp_path / "rings.toml"
    file.write_text(
        "[chains]\ncount = 2\nbeads = 5\nradius = 1.0\nspacing = 2.2\nbox = [30, 30]\nseed = 1\nring = true\n"
        '[parameters]\neta = 1.0\n[flow]\ndrag = 1.0\n[until]\nt = 1.0\n[[bond]]\npairs = "chains"\n'
        'potential = "hooke"\nparameters = {k = 1.0, d = 2.2}\n'
    )
    scene = read_particle_scene(file)
    assert np.array_equal(scene.bond[0].pairs, chain_pairs(2, 5, True))
    assert check(scene).reach == 0.0


def test_chains_without_room_or_bonds_are_refused() -> None:
    crowded = Chains(count=40, beads=8, radius=1.0, spacing=2.0, box=[12.0, 12.0], seed=1)
    with pytest.raises(SceneError, match=r"\[chains\] there is no room for 40 of 8 beads: \d+ were placed"):
        placed_chains(crowded)
    with pytest.raises(SceneError, match=r'\[chains\] has no bonds: give \[\[bond\]\] pairs = "chains"'):
        ParticleScene(parameters={"eta": 1.0}, chains=crowded, drag=1.0, until_t=1.0)


# refusals


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bond": [Bond(**{**HOOKE, "pairs": [[1, 1]]})]}, "particle 1 is bonded to itself"),
        ({"bond": [Bond(**{**HOOKE, "pairs": [[0, 2]]})]}, "there is no particle 2; they are numbered 0 to 1"),
        ({"bond": [Bond(**{**HOOKE, "pairs": [[0, 1], [1, 0]]})]}, "particles 0 and 1 are bonded twice"),
        ({"bond": [Bond(**{**HOOKE, "pairs": [0, 1]})]}, "must be a list of pairs of whole numbers"),
        ({"bond": [Bond(**{**HOOKE, "pairs": "chains"})]}, r"are those of chains that are generated: give \[chains\]"),
        ({"bond": [Bond(**{**FENE, "parameters": {"k": 1.0, "Q": 0.3, "d": 2.0}})]},
         "particles 0 and 1 are 2.4 apart at the start, beyond the distances at which fene holds"),
        ({"bond": [Bond(**HOOKE, breaks_at_length=2.3)]}, "2.4 apart at the start, where the bond breaks"),
        ({"bond": [Bond(**{**HOOKE, "parameters": {"k": 1.0}})]}, "d is missing; hooke has k, d"),
        ({"bond": [Bond(**{**HOOKE, "parameters": {"k": -1.0, "d": 2.0}})]}, "k must be positive, not -1.0"),
        ({"bond": [Bond(**{**HOOKE, "parameters": {"k": 1.0, "d": 2.0, "q": 1.0}})]}, "'q' is not one of hooke"),
        ({"bond": [Bond(**{**HOOKE, "potential": "hook"})]}, "unknown potential 'hook'; did you mean 'hooke'"),
        ({"bond": [Bond(**HOOKE)], "drag": 0.0}, r"give \[flow\] drag, 1 for Stokes' drag"),
        ({"potential": [PairPotential("morse", MORSE.parameters)], "box": [20.0, 20.0]}, "cut_off is missing"),
        ({"potential": [PairPotential("lennard_jones", {"epsilon": 1.0, "sigma": 1.0})],
          "positions": [[0, 0], [0, 0]]}, "lennard_jones has no finite force between particles 0 and 1"),
        ({"potential": [PairPotential("morse", MORSE.parameters, between=["a", "b"])]}, "there is no species 'a'"),
        ({"potential": [MORSE], "range": 1.0}, r"\[contacts\] range is of contacts with a law"),
        ({"potential": [MORSE], "parameters": {}}, "eta is missing"),
        ({"bond": [Bond(**HOOKE)], "inertia": Inertia(1.0), "drag": 0.0, "law": "hertz_dry",
          "parameters": {"E": 1.0, "nu": 0.5}, "method": "explicit"},
         r"\[\[bond\]\] is not known to the method explicit"),
        ({}, "law is missing"),
    ],
)  # fmt: skip
def test_wrong_scenes_are_refused_by_name(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate_particles(pair(2.4, **changes))


@pytest.mark.slow
def test_masses_on_a_spring_swing_at_its_frequency() -> None:
    """Of two equal ones omega^2 = 2 k/m, while they do not touch; by implicit steps, which know bonds and inertia."""
    k, mass = 2.0, 4 / 3 * math.pi
    spring = Bond([[0, 1]], "hooke", {"k": k, "d": 3.0})
    dry = {"law": "hertz_dry", "parameters": {"E": 1.0, "nu": 0.5}, "drag": 0.0, "inertia": Inertia(1.0)}
    omega = math.sqrt(2 * k / mass)
    result = simulate_particles(pair(3.2, bond=[spring], until_t=4.5 / omega, rtol=1e-6, times=5, **dry))
    apart = result.x[:, 1, 0] - result.x[:, 0, 0]
    np.testing.assert_allclose(apart, 3 + 0.2 * np.cos(omega * result.t), atol=1e-4)
    assert abs(result.energy["imbalance"]) < 1e-4


def test_a_bond_that_is_torn_beyond_its_length_ends_the_run_by_name() -> None:
    """Particles that are driven apart: the bond has no force there, and the run tells which, and where it came to."""
    held = [Hold([0], "xy"), Hold([1], "xy", [1.0, 0.0])]
    scene = pair(2.1, bond=[Bond(**FENE)], hold=held, rtol=1e-2, until_t=2.0)
    with pytest.raises(IntegrationError, match=r"particles 0 and 1, at r=.*beyond the distances") as told:
        simulate_particles(scene)
    assert told.value.partial.step_t[-1] == pytest.approx(0.9, abs=1e-3)


@pytest.mark.slow
def test_a_picture_of_bonds_shows_those_that_hold(tmp_path: Path) -> None:
    """Across the faces of the box, too."""
    chains = Chains(count=2, beads=5, radius=1.0, spacing=2.1, box=[16.0, 16.0], seed=2)
    bond = Bond("chains", "hooke", {"k": 1.0, "d": 2.0}, breaks_at_length=2.11)
    result = simulate_particles(
        ParticleScene(
            parameters={"eta": 1.0}, chains=chains, bond=[bond], drag=1.0, shear_rate=1.0, until_t=0.3, times=4
        )
    )
    assert 0 < result.stats["bonds_broken"] < 8
    i, j, along, tension = bonds_at(result, -1)
    assert len(i) == len(j) == 8 - result.stats["bonds_broken"]
    np.testing.assert_allclose(np.linalg.norm(along, axis=1) - 2.0, tension, rtol=1e-9)
    picture = tmp_path / "chains.png"
    result.plot().savefig(picture)
    assert picture.stat().st_size > 10_000


def test_beside_a_dry_contact_a_potential_has_a_share_of_its_own_in_the_balance() -> None:
    """Drawn into touch by a well: what is stored is that of both, and drag takes the rest."""
    result = simulate_particles(
        pair(2.2, law="hertz_dry", parameters={"eta": 1 / (6 * math.pi), "E": 2.0, "nu": 0.5}, until_t=2.0, rtol=1e-6,
             potential=[PairPotential("morse", {"De": 1.0, "b": 2.0, "d": 1.8}, cut_off=4.0)])
    )  # fmt: skip
    assert 1.8 < distance(result) < 2.0
    assert result.contact_F[-1] > 0
    assert abs(result.energy["imbalance"]) < 1e-5
    assert result.energy["drag"] == pytest.approx(-result.energy["stored"], rel=1e-5)
