"""What softdyn and softdyn.particles offer is there, and scenes of either kind go through one door."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softdyn

PAIR = """
law = "rognon_gay"
parameters = {R = 1.0, E = 1.0, eta = 1.0}
pair = {h = 1.0}
drive = {force = 0.01}
until = {h = 0.1}
"""


def test_everything_offered_is_there() -> None:
    """Lazily, by one name each; read_scene and simulate take either kind of scene."""
    for module in (softdyn, softdyn.particles):
        assert set(module.__all__) <= set(dir(module))
        for name in module.__all__:
            assert getattr(module, name) is not None
        with pytest.raises(AttributeError, match="no attribute 'nonesuch'"):
            _ = module.nonesuch


@pytest.mark.slow
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
    path.write_text(PAIR)
    assert isinstance(softdyn.read_scene(str(path)), softdyn.Scene)
    with pytest.raises(softdyn.SceneError, match=r"a scene of two particles, with \[pair\]"):
        softdyn.particles.read_scene(path)
    with pytest.raises(softdyn.SceneError, match="simulate takes a scene, or the path of a scene file"):
        softdyn.simulate({"law": "rognon_gay"})  # type: ignore[arg-type]


@pytest.mark.slow
def test_regimes_print_as_a_line_each() -> None:
    """Of a law, and of a closure: where each is, and its leading forms."""
    lines = str(softdyn.regimes("rognon_gay")).splitlines()
    assert len(lines) == len(softdyn.regimes("rognon_gay").regimes)
    assert any("Poiseuille" in line and "dh_dt = -F*h/(6*pi*R**2*eta)" in line for line in lines)
    assert str(softdyn.regimes("ergun")).splitlines() == [
        "Blake-Kozeny   Re << 600*phi/(7*c)  drag = 50*pi*eta*phi*r/c",
        "Burke-Plummer  600*phi/(7*c) << Re  drag = 7*pi*Re*eta*r/12",
    ]
