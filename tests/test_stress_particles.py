"""Random small scenes of particles against their equations, written down once more: none is silently wrong."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from softdyn.cli import main
from softdyn.stress.judge import RIGHT, TOLD, WRONG
from softdyn.stress.particles.compare import judge_case
from softdyn.stress.particles.report import stress_particles
from softdyn.stress.particles.sampling import random_case


@pytest.mark.parametrize("seed", [10])
def test_a_scene_is_what_its_equations_say(seed: int) -> None:
    verdict = judge_case(seed, random_case(seed))
    assert verdict.outcome == RIGHT, verdict
    assert verdict.error < 100 * verdict.rtol


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
def test_no_scene_is_silently_wrong(tmp_path: Path) -> None:
    """Most are right; few are refused, or too stiff for the reference. All 300: ``softdyn stress particles``."""
    report = stress_particles(tmp_path, scenes=30)
    assert not report["counts"].get(WRONG), (tmp_path / "particles.txt").read_text(encoding="utf-8")
    assert report["counts"][RIGHT] >= 20


@pytest.mark.slow
def test_the_command_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stress", "particles", "--scenes", "1", "-o", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert "1 random scenes: 1 right, 0 told, 0 refused, 0 wrong" in text
    assert json.loads((tmp_path / "particles.json").read_text(encoding="utf-8"))["counts"] == {"right": 1}
    assert (tmp_path / "particles.png").stat().st_size > 1000
