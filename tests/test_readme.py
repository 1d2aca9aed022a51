"""What the README shows is what works: its snippets run, in order, as one program; its scene files are read."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.particles.files import particle_scene_from
from softdyn.particles.particle_scene import check
from softdyn.scene.pair_scene import check_scene, scene_from
from softdyn.scene.reading import is_particle_scene

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def snippets(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """Everything in Python, typed in by somebody in a folder of their own: all names, and the folder."""
    folder = tmp_path_factory.mktemp("reader")
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for snippet in snippets("python"):
            exec(compile(snippet, "README.md", "exec"), names)
    return names, folder


def test_a_law_is_declared_and_a_pair_is_run(reader: tuple[dict[str, Any], Path]) -> None:
    names, _ = reader
    assert [finding.verdict for finding in softdyn.check(names["law"])] == ["proved"]
    many = names["many"]
    assert many.t.shape == (10_000, 50)
    assert not many.errors
    assert not many.warnings


def test_many_particles_are_packed_sheared_measured_and_drawn(reader: tuple[dict[str, Any], Path]) -> None:
    names, folder = reader
    result = names["result"]
    assert result.t[-1] == 100.0
    assert not result.stats["warnings"]
    # some ten times the fluid's, of some three contacts each: dense and not jammed
    assert np.all(names["viscosity"][1:] > 5)
    assert np.all((names["contacts"] > 2) & (names["contacts"] < 6))
    assert (folder / "sheared.png").stat().st_size > 10_000


def test_scene_files_are_read(tmp_path: Path) -> None:
    pair, drive, particles = (tomllib.loads(text) for text in snippets("toml"))
    assert not is_particle_scene(pair)
    for data in (pair, {**pair, **drive}):
        check_scene(scene_from(data, tmp_path))
    assert is_particle_scene(particles)
    check(particle_scene_from({**particles, "packing": {**particles["packing"], "count": 100}}, tmp_path))


def test_everything_offered_is_there() -> None:
    """Lazily, by one name each; read_scene and simulate take either kind of scene."""
    for module in (softdyn, softdyn.particles):
        assert set(module.__all__) <= set(dir(module))
        for name in module.__all__:
            assert getattr(module, name) is not None
        with pytest.raises(AttributeError, match="no attribute 'nonesuch'"):
            _ = module.nonesuch


def test_scenes_of_either_kind_are_read_and_run_from_one_place(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        'law = "rognon_gay"\nparameters = {E = 1.0, eta = 1.0}\nuntil = {t = 1.0}\nflow = {drag = 1.0}\n'
        "particles = {positions = [[0, 0], [2.1, 0]], radii = 1.0}\n"
    )
    scene = softdyn.read_scene(path)
    assert isinstance(scene, softdyn.particles.ParticleScene)
    results = [softdyn.simulate(scene), softdyn.simulate(path), softdyn.particles.simulate(scene)]
    results.append(softdyn.load_result(results[0].save(tmp_path / "a.npz")))
    for result in results:
        assert isinstance(result, softdyn.particles.ParticleResult)
        np.testing.assert_array_equal(result.x, results[0].x)
    path.write_text(snippets("toml")[0])
    assert isinstance(softdyn.read_scene(str(path)), softdyn.Scene)
    with pytest.raises(softdyn.SceneError, match=r"a scene of two particles, with \[pair\]"):
        softdyn.particles.read_scene(path)
    with pytest.raises(softdyn.SceneError, match="simulate takes a scene, or the path of a scene file"):
        softdyn.simulate({"law": "rognon_gay"})  # type: ignore[arg-type]
