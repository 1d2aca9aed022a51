"""Random small scenes of particles against their equations, written down once more: none is silently wrong."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sympy import Symbol, lambdify

from softdyn.cli import main
from softdyn.expression import evaluate, parse
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import UNBALANCED, UNSEEN
from softdyn.particles.results import ParticleResult
from softdyn.stress.judge import RIGHT, TOLD, WRONG
from softdyn.stress.particles import verdicts as compare
from softdyn.stress.particles.cases import first_surroundings, set_up
from softdyn.stress.particles.integration import near, settled
from softdyn.stress.particles.own_equations import geometry, jacobian, pack, tell
from softdyn.stress.particles.sampling import random_case
from softdyn.stress.particles.scene_report import stress_particles
from softdyn.stress.particles.verdicts import judge_case


# 9: surfaces stick without drag, and forces jump
@pytest.mark.slow
@pytest.mark.parametrize("seed", [10, pytest.param(9, marks=pytest.mark.slow)])
def test_a_scene_is_what_its_equations_say(seed: int) -> None:
    verdict = judge_case(seed, random_case(seed))
    assert verdict.outcome == RIGHT, verdict
    assert verdict.error < 100 * verdict.rtol


@pytest.mark.slow
def test_another_friction_or_elasticity_is_seen() -> None:
    """The judge is not kind: a reference whose law is off by a tenth calls the engine wrong."""
    case = random_case(10)
    for other in (replace(case.law, zeta=case.law.zeta * 11 / 10), replace(case.law, F_ela=case.law.F_ela * 11 / 10)):
        verdict = judge_case(10, replace(case, law=other))
        assert verdict.error > verdict.allowed, verdict
        assert verdict.outcome in (WRONG, TOLD)


def test_scenes_of_a_seed_are_the_same_again() -> None:
    for seed in range(8):
        one, other = random_case(seed), random_case(seed)
        assert one.kind == other.kind
        assert one.scene.positions == other.scene.positions
        assert one.scene.parameters == other.scene.parameters


@pytest.mark.slow
def test_all_mechanisms_and_drives_are_sampled() -> None:
    """Among a third of the scenes of the report each is met, pulses, tables, kinks and jumps among them."""
    kinds = [random_case(seed).kind for seed in range(100)]
    found = Counter(name for kind in kinds for name in kind.split(", "))
    drives = {"expression", "pulse", "gate", "table", "kink", "jump"}
    mechanisms = {
        "tangential",
        "torque",
        "spin",
        "box",
        "imposed stress",
        "shear",
        "soft wall",
        "rigid wall",
        "no drag",
    }
    assert min(found[name] for name in drives | mechanisms | {"1D", "2D", "3D", "free cluster", "moving wall"}) >= 1
    assert any(kind.startswith("3D, no drag") and "tangential" in kind for kind in kinds)
    assert any("no drag" in kind and "tangential" in kind and "jump" in kind for kind in kinds)


@pytest.mark.slow
def test_what_the_reference_takes_for_a_drive_is_what_its_text_says() -> None:
    """Piece by piece, at times between the breaks."""
    t, random = Symbol("t", real=True), np.random.default_rng(1)
    for seed in range(60):
        case = random_case(seed)
        until = float(case.scene.until_t)
        for text, pieces in case.drives.items():
            starts = [start for start, _ in pieces]
            assert starts == sorted(starts)
            size = max(abs(evaluate(parse(text), float(when))) for when in np.linspace(0.0, until, 50))
            for when in random.uniform(0.0, until, 5):
                expr = [expr for start, expr in pieces if start <= when][-1]
                value = lambdify(t, expr, modules="math")(float(when))
                assert math.isclose(evaluate(parse(text), float(when)), value, rel_tol=1e-9, abs_tol=1e-9 * size)


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # of branches that do not hold
@pytest.mark.parametrize("seed", [1, 15, 24, 34])
def test_the_jacobian_of_the_reference_is_exact(seed: int) -> None:
    """Against central differences of the rates, for films, sliding, boxes under stress, with and without drag."""
    case = random_case(seed)
    x = np.array(case.scene.positions, dtype=float)
    z = first_surroundings(case.scene, x.shape[1])
    eq = set_up(case, sorted(near(case, x, z)))
    random, place = np.random.default_rng(seed), np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
    least = float(case.scene.gap or 0.01 * eq.radii.min())
    gap = np.maximum(geometry(eq, place, z)[1] - eq.S, least) + least * random.uniform(-0.5, 0.5, len(eq.pairs))
    T = 1e-4 * random.normal(size=(len(eq.pairs), 3)) * float(np.abs(eq.law_of(gap, 0 * gap, *eq.q)[2]).max())
    T *= eq.radii.min()
    state, mode = settled(eq, 0.0, pack(eq, place, np.log(gap), T, z), 0)
    exact = jacobian(eq, 0.0, state, 0, mode)
    length = float(eq.radii.min())
    sizes = pack(
        eq, np.full((eq.count, 3), length), np.ones(len(gap)), np.full(T.shape, np.abs(T).max()), np.ones(len(z))
    )
    for k, size in enumerate(1e-6 * sizes):
        step = np.where(np.arange(len(state)) == k, size, 0.0)
        ahead, behind = (tell(eq, 0.0, state + sign * step, 0, mode).rates for sign in (1, -1))
        scale = np.abs(exact[:, k]).max() + np.abs(tell(eq, 0.0, state, 0, mode).rates).max() / sizes[k]
        np.testing.assert_allclose((ahead - behind) / (2 * size), exact[:, k], rtol=1e-4, atol=1e-4 * scale)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("warning", "outcome"),
    [
        (f"{UNBALANCED} 1e-3 of the sum of its terms", TOLD),
        (f"[[push]] 0: force along x {UNSEEN} near t=1", TOLD),
        ("so many particles without drag are not searched for motions that nothing resists", WRONG),
        ("the pressure is negative under shear", WRONG),
    ],
)
def test_only_a_warning_of_the_numbers_excuses_a_wrong_one(
    warning: str, outcome: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, run = random_case(10), compare.simulate_particles

    def wrong(scene: ParticleScene, **more: Any) -> ParticleResult:
        result = run(scene, **more)
        result.arrays["x"][-1, 0] += result.radii.min()
        result.stats["warnings"] = [warning]
        return result

    monkeypatch.setattr(compare, "simulate_particles", wrong)
    assert judge_case(10, case).outcome == outcome


@pytest.mark.slow
def test_no_scene_is_silently_wrong(tmp_path: Path) -> None:
    """Nearly all are right. CI judges 24, and ``softdyn stress particles`` 300."""
    report = stress_particles(tmp_path, scenes=8)
    assert not report["counts"].get(WRONG), (tmp_path / "particles.txt").read_text(encoding="utf-8")
    assert report["counts"][RIGHT] >= 7


@pytest.mark.slow
def test_the_command_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stress", "particles", "--scenes", "1", "-o", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "1 random scenes: 1 right, 0 told, 0 refused, 0 wrong" in text
    assert json.loads((tmp_path / "particles.json").read_text(encoding="utf-8"))["counts"] == {"right": 1}
    assert (tmp_path / "particles.png").stat().st_size > 1000
