"""Runs tell of films that are pulled: by much, by many, or until the whole is in tension; stock scenes have none."""

from __future__ import annotations

import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.errors import IntegrationError
from softdyn.particles import Hold, ParticleResult, ParticleScene, Push, integrate, pressure, simulate
from softdyn.particles.files import particle_scene_from
from softdyn.particles.pulled_films import Pulled, look, pulled_films
from softdyn.scene.stock_scenes import particle_scenes
from softdyn.stress.particles import verdicts as compare
from softdyn.stress.particles.sampling import random_case

SOFT: dict[str, Any] = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}}
DROPLETS: dict[str, Any] = {"law": "droplet", "parameters": {"sigma": 1.0, "eta": 1.0}}
KINDS = ("is pulled to a deflection", "pulled films bear", "the pressure is negative under shear")


def kinds(result: ParticleResult) -> list[str]:
    """Which kinds of warnings a result has, each with its time and its particles."""
    found = []
    for warning in result.stats["warnings"]:
        (kind,) = [kind for kind in KINDS if kind in warning]
        assert "of particles " in warning
        assert warning.count("at t=") == 2, "the worst, and the first"
        found.append(kind)
    assert len(set(found)) == len(found), "once for each kind"
    return found


def stock(name: str, **changes: Any) -> ParticleResult:
    """Run a stock scene, with changes such as ``flow__shear_rate``."""
    data = tomllib.loads(particle_scenes()[name].read_text())
    for place, value in changes.items():
        section, _, key = place.partition("__")
        if key:
            data[section][key] = value
        else:
            data[section] = value
    return simulate(particle_scene_from(data, Path()))


def apart(speed: float, **law: Any) -> ParticleResult:
    """Two spheres in touch, moved apart by half a radius."""
    return simulate(
        ParticleScene(
            **law, positions=[[0.0, 0.0], [2.0, 0.0]], radii=1.0, gap=0.004, times=101, until_t=0.5 / speed,
            hold=[Hold([0], "xy"), Hold([1], "xy", velocity=[speed, 0.0])],
        )
    )  # fmt: skip


@pytest.mark.slow
def test_a_pair_that_is_held_shut_while_it_is_moved_apart_is_told_of() -> None:
    """The paper's law stretches it by a quarter of a radius; where a pulled film narrows, it opens, and nothing is."""
    stretched = apart(1e-5, **SOFT)
    assert kinds(stretched) == [KINDS[0]]
    first = stretched.t[np.argmax(-stretched.contact_delta > 0.1)]
    worst = stretched.t[np.argmin(stretched.contact_delta)]
    assert not set(stretched.step_t) & {first}, "a frame within a step is looked at too"
    (warning,) = stretched.stats["warnings"]
    assert f"is pulled to a deflection of {-stretched.contact_delta.min():.3g} radii at t={worst:.6g}" in warning
    assert f"first above 0.1 at t={first:.6g}, for particles 0 and 1" in warning
    assert kinds(apart(1e-5, **{**SOFT, "law": "equal_spheres", "parameters": {**SOFT["parameters"], "nu": 0.5}})) == []


def test_what_is_pulled_between_two_frames_is_told_of() -> None:
    """A surface that is pulled and pressed again within a hundredth of the time between the frames."""
    pulse = "0.3*exp(-((t - 500)/10)**2)"
    result = simulate(
        ParticleScene(
            **SOFT, positions=[[0.0, 0.0], [2.0, 0.0]], radii=1.0, gap=0.01, until_t=2000.0, times=2,
            push=[Push([0], [f"0.01 - {pulse}", 0.0]), Push([1], [f"{pulse} - 0.01", 0.0])],
        )
    )  # fmt: skip
    assert (result.contact_delta > -0.1).all(), "nothing of it is in the frames"
    assert kinds(result) == [KINDS[0]]
    (warning,) = result.stats["warnings"]
    told = float(warning.split("radii at t=")[1].split()[0])
    assert abs(told - 500) < 5


@pytest.mark.slow
def test_a_look_costs_less_than_a_hundredth_of_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """In processor time, of a whole run in which many contacts are pulled."""
    spent = 0.0

    def timed(*given: Any) -> None:
        nonlocal spent
        began = time.thread_time()
        look(*given)
        spent += time.thread_time() - began

    monkeypatch.setattr(integrate, "look", timed)
    began = time.process_time()
    result = stock("suspension", until__strain=0.02, output__times=2)
    assert (result.contact_F < 0).mean() > 0.03
    assert 0 < spent < 0.01 * (time.process_time() - began)


@pytest.mark.slow
def test_a_warning_of_a_pulled_film_excuses_no_wrong_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what is compared with a reference: it tells of the physics alone."""
    case = random_case(10)
    assert compare.judge_case(10, case).outcome == compare.RIGHT
    run = compare.simulate_particles

    def wrong(scene: ParticleScene) -> ParticleResult:
        result = run(scene)
        result.arrays["x"][-1] += result.radii.min()
        told = Pulled()
        told.note("stretched", 0.5, 1.0, "particles 0 and 1")
        for name in ("pulled", "warnings"):
            result.stats[name].extend(pulled_films(told))
            assert result.stats[name]
        return result

    monkeypatch.setattr(compare, "simulate_particles", wrong)
    assert compare.judge_case(10, case).outcome == compare.WRONG


def test_a_deflection_is_measured_in_the_smaller_radius() -> None:
    def pulled(radius: float) -> ParticleResult:
        pushes = [Push([0], [-0.15, 0.0]), Push([1], [0.15, 0.0])]
        places = [[0.0, 0.0], [3.02, 0.0]]
        return simulate(
            ParticleScene(**SOFT, positions=places, radii=[3.02 - radius, radius], gap=0.02, push=pushes, until_t=1.0)
        )

    deepest = {radius: float(np.max(-pulled(radius).contact_delta)) for radius in (0.5, 1.5)}
    for radius, delta in deepest.items():
        assert (kinds(pulled(radius)) == [KINDS[0]]) == (delta > 0.1 * radius)
    assert any(delta > 0.1 * radius for radius, delta in deepest.items())


@pytest.mark.parametrize("runs", [1, 2])
def test_the_pair_engine_tells_of_it_too(runs: int) -> None:
    """One run, and many in one call."""
    both = np.array([-1e-3, -0.2])[-runs:]
    pair = {"parameters": {"R": 1.0, "E": 1.0, "eta": 1.0}, "h": 0.01, "until_t": 1.0, "times": 3}
    found = softdyn.simulate(law="rognon_gay", force=both if runs > 1 else -0.2, **pair)
    (warning,) = found.warnings[1] if runs > 1 else found.warnings
    delta = np.atleast_2d(found.delta)[-1]
    assert f"the surfaces are pulled by {-delta.min():.3g} R" in warning
    assert "(first above 0.1 R at t=0)" in warning
    if runs > 1:
        assert 0 not in found.warnings
    assert not softdyn.simulate(law="rognon_gay", force=0.2, **pair).warnings, "pressed by as much"


@pytest.mark.slow
def test_a_flow_whose_films_are_held_shut_is_told_of() -> None:
    """A sheared emulsion with the paper's law becomes a stretched solid; with that of droplets it flows."""
    few: dict[str, Any] = {"packing__count": 100, "flow__shear_rate": 1e-6, "until__strain": 1.4}
    solid = stock("emulsion", **SOFT, **few)
    assert kinds(solid) == list(KINDS)
    assert pressure(solid)[-1] < 0
    # a little later it presses one contact as wide as a sphere
    few["until__strain"] = 2.0
    with pytest.raises(IntegrationError, match="flattened over a radius of"):
        stock("emulsion", **SOFT, **few)
    few["flow__shear_rate"] = 1e-4
    assert kinds(stock("emulsion", **few)) == []


@pytest.mark.slow
def test_nearly_rigid_spheres_that_part_in_a_flow_pull_on_no_film() -> None:
    """They pull on one another as much as they press, in the flow of a fluid; their surfaces stay round."""
    spheres = stock("spheres", packing__count=40, until__strain=0.3, output__times=7)
    F = spheres.contacts(2)["F"]
    assert -F[F < 0].sum() > 0.2 * np.abs(F).sum()
    assert "pulled films bear" not in " ".join(spheres.stats["warnings"])


def steady(result: ParticleResult, floor: float) -> None:
    """Mean shear stresses of the third and the fourth quarter agree within their scatter, and nothing is in tension."""
    shear = (result.stress[:, 0, 1] + result.stress[:, 1, 0]) / 2
    frames = len(result)
    third, fourth = shear[frames // 2 : 3 * frames // 4], shear[3 * frames // 4 :]
    # at rest where the scatter is less than what rtol leaves of it
    scatter = max(third.std(), fourth.std(), floor * abs(fourth.mean()))
    assert abs(third.mean() - fourth.mean()) < scatter
    assert third.mean() > 3 * scatter, "a stress, and not its scatter"
    assert np.all(pressure(result)[1:] > 0)
    assert result.stats["warnings"] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["emulsion", "suspension"])
def test_stock_scenes_of_many_particles_reach_a_steady_state(name: str) -> None:
    result = stock(name)
    assert result.law != "rognon_gay"
    steady(result, 0.02)


@pytest.mark.parametrize("name", ["t1", "two", "line"])
def test_stock_scenes_of_the_papers_law_keep_its_surfaces_pressed(name: str) -> None:
    """But for what a T1 process parts, by less than the law is told to bear."""
    result = stock(name)
    assert result.law == "rognon_gay"
    assert kinds(result) == []
