"""A result tells what made it: its scene, run again, gives the same numbers to the last bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sympy import pi, sqrt

import softdyn
from softdyn import cli
from softdyn.derive import ContactLaw, E, R, delta, eta, h
from softdyn.errors import SceneError
from softdyn.particles import Hold, ParticleScene, Push, Wall, from_result
from softdyn.results.rerun import differences

PAIR: dict[str, Any] = {"law": "rognon_gay", "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0}, "h": 0.5}
TIMES = np.linspace(0.0, 100.0, 200)


def many() -> ParticleScene:
    """A scene with a word for everything that plain data have none for."""
    return ParticleScene(
        law="steric",
        parameters={"E": {"soft": 1.0, "hard": 3.0}, "eta": 1.0, "nu": 0.5, "Pi0": 0.01, "L": 0.02},
        positions=np.array([[2.0 * k, 1.05 + 0.01 * k] for k in range(40)]),
        radii=np.linspace(0.9, 1.0, 40),
        species=["soft", "hard"] * 20,
        range=0.5,
        drag=1.0,
        push=[Push([3, 4], ["F*sin(t)", 0.0]), Push("hard", [(TIMES, 1e-3 * np.cos(TIMES)), -1e-3])],
        hold=[Hold([0], "xy", velocity=[0.0, softdyn.Table(TIMES, 1e-4 * TIMES)])],
        wall=[Wall([0.0, 0.0], np.array([0.0, -1.0]), rigid=True)],
        constants={"F": 1e-3},
        until_t=3.0,
        times=4,
    )


PAIRS = {
    "a number": softdyn.Scene(**PAIR, force=1e-2, until_h=0.1, gaps=5),
    "an expression": softdyn.Scene(**PAIR, force="F*cos(t)", constants={"F": 1e-2}, until_t=10.0, times=[1.0, 10.0]),
    "arrays": softdyn.Scene(**PAIR, force=(TIMES, 1e-2 * np.sin(TIMES)), until_t=50.0, times=np.array([1.0, 49.0])),
    "a spring": softdyn.Scene(**PAIR, spring={"stiffness": 0.1, "base": "2.4 - 1e-3*t"}, until_t=50.0, times=5),
}


@pytest.mark.parametrize("ending", [".json", ".npz"])
@pytest.mark.parametrize("name", PAIRS)
def test_a_pair_is_made_again_to_the_bit(name: str, ending: str, tmp_path: Path) -> None:
    result = softdyn.simulate(PAIRS[name])
    read = softdyn.load_result(result.save(tmp_path / f"run{ending}"))
    again = softdyn.simulate(softdyn.scene_of(read))
    assert differences(result, again) == {}
    # saved once more it tells the same
    twice = softdyn.load_result(read.save(tmp_path / f"twice{ending}"))
    assert differences(result, softdyn.simulate(softdyn.scene_of(twice))) == {}


@pytest.mark.slow
def test_many_particles_are_made_again_to_the_bit(tmp_path: Path) -> None:
    result = softdyn.simulate(many())
    read = softdyn.load_result(result.save(tmp_path / "run.npz"))
    assert read.arrays.keys() == result.arrays.keys()
    assert differences(result, softdyn.simulate(softdyn.scene_of(read))) == {}
    twice = softdyn.load_result(read.save(tmp_path / "twice.npz"))
    assert differences(result, softdyn.simulate(softdyn.scene_of(twice))) == {}


@pytest.mark.slow
def test_a_run_that_goes_on_from_another_tells_its_own_start(tmp_path: Path) -> None:
    first = softdyn.simulate(many())
    scene = replace(many(), **from_result(first))
    second = softdyn.simulate(scene)
    read = softdyn.load_result(second.save(tmp_path / "second.npz"))
    assert differences(second, softdyn.simulate(softdyn.scene_of(read))) == {}


def test_the_command_tells_that_all_is_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = softdyn.simulate(PAIRS["a number"]).save(tmp_path / "run.npz")
    assert cli.main(["rerun", str(path), "-o", str(tmp_path / "again.json")]) == 0
    assert "arrays are the same, to the last bit" in capsys.readouterr().out
    assert softdyn.load_result(tmp_path / "again.json").origin is not None


LAW = """
from softdyn.derive import ContactLaw, E, R, delta, eta, h
from sympy import Abs, pi, sqrt
law = ContactLaw(name="mine", a=sqrt(R*(h + Abs(delta))), F_ela=E*R*delta, zeta={number}*pi*eta*R**2/h)
"""


@pytest.mark.slow
def test_a_law_file_that_has_changed_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    law = tmp_path / "mine.py"
    law.write_text(LAW.format(number=6))
    result = softdyn.simulate(**{**PAIR, "law": law}, force=1e-2, until_h=0.1)
    path = result.save(tmp_path / "run.npz")
    assert cli.main(["rerun", str(path)]) == 0
    law.write_text(LAW.format(number=5))
    assert cli.main(["rerun", str(path)]) == 2
    assert "the law 'mine' is not the one that made it: its equations have changed" in capsys.readouterr().err


@pytest.mark.slow
def test_a_law_that_was_an_object_cannot_be_found_again(tmp_path: Path) -> None:
    law = ContactLaw(name="mine", a=sqrt(R * h), F_ela=E * R * delta, zeta=6 * pi * eta * R**2 / h)
    result = softdyn.simulate(**{**PAIR, "law": law}, force=1e-2, until_h=0.1)
    assert softdyn.scene_of(result).law is law
    read = softdyn.load_result(result.save(tmp_path / "run.npz"))
    with pytest.raises(SceneError, match="made with 'mine', an object of a program: run that program again"):
        softdyn.scene_of(read)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda about: about.update(format=2), "of version 2, which a later softdyn writes: this one reads up to 1"),
        (lambda about: about.update(kind="plasma"), "of the kind 'plasma', which a later softdyn writes"),
        (lambda about: about.update(origin=3), "what it says of the scene that made it is none"),
        (lambda about: about["origin"]["scene"].update(colour=1), "has 'colour', which this version does not know"),
        (
            lambda about: about["origin"]["scene"].update(h={"section": "run", "fields": {}}),
            "there is no section 'run'",
        ),
        (lambda about: about["origin"]["scene"].update(h={"table": [1]}), "made it is none"),
        (lambda about: about["origin"]["scene"].update(h="import os"), "must be a number|positive"),
    ],
)
def test_what_a_file_says_of_its_scene_is_checked(change: Any, words: str, tmp_path: Path) -> None:
    path = softdyn.simulate(PAIRS["a number"]).save(tmp_path / "run.json")
    about = json.loads(path.read_text())
    change(about)
    path.write_text(json.dumps(about))
    with pytest.raises(SceneError, match=words):
        softdyn.simulate(softdyn.scene_of(softdyn.load_result(path)))


def test_results_of_earlier_versions_are_read_and_tell_that_they_do_not_know(tmp_path: Path) -> None:
    path = softdyn.simulate(PAIRS["a number"]).save(tmp_path / "run.json")
    about = json.loads(path.read_text())
    path.write_text(
        json.dumps({name: value for name, value in about.items() if name not in ("format", "origin", "kind")})
    )
    with pytest.raises(SceneError, match="does not tell the scene that made it: an earlier version"):
        softdyn.scene_of(softdyn.load_result(path))


@pytest.mark.slow
def test_results_of_both_kinds_have_the_same_verbs() -> None:
    pair, particles = softdyn.simulate(PAIRS["a number"]), softdyn.simulate(many())
    for result in (pair, particles):
        assert len(repr(result)) < 100
        assert {*result.arrays, "plot", "save", "to_xarray", "to_pandas", "warnings"} <= {*dir(result)}
        assert isinstance(result.warnings, tuple)
        assert result._repr_png_()[:4] == b"\x89PNG"
        found = result.to_xarray()
        assert found.attrs["law"] == result.law
        assert all(np.array_equal(found[name].values, array) for name, array in result.arrays.items())
        table = result.to_pandas()
        np.testing.assert_array_equal(table.index, result.t)
    assert particles.to_xarray().x.dims == ("frame", "particle", "axis")
    assert particles.to_xarray().stress.dims == ("frame", "axis", "other_axis")
    np.testing.assert_array_equal(particles.to_pandas().stress_xy, particles.stress[:, 0, 1])
    np.testing.assert_array_equal(particles.to_pandas().energy_drag, particles.energy_drag)
    np.testing.assert_array_equal(pair.to_pandas().h, pair.h)
