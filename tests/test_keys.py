"""One table of keys: what is read, checked, typed and told of a scene follows from where each key is declared."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import MISSING
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn import particles
from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.particles.driven import require_used
from softdyn.particles.files import particle_scene_from
from softdyn.scene.key_words import entries, page, schema, told
from softdyn.scene.keys import Key, all_keys, driven_values, rows
from softdyn.scene.pair_scene import Scene, scene_from
from softdyn.scene.stock_scenes import particle_scenes

ROOT = Path(softdyn.__file__).parents[1]
PAIR = {"law": "rognon_gay", "parameters": {"R": 1.0, "E": 1.0, "eta": 1.0}, "pair": {"h": 1.0}}
MANY: dict[str, Any] = {"law": "rognon_gay", "parameters": {"E": 1.0, "eta": 1.0}, "until": {"t": 1.0}}


def test_every_field_of_a_scene_has_a_key() -> None:
    """No keyword of Python is without a place in files, but what is declared to be of Python alone."""
    for cls in (Scene, particles.ParticleScene, particles.Push, particles.Hold, particles.Wall, particles.Packing):
        declared = {row.field for row in rows(cls)}
        assert declared == set(cls.__dataclass_fields__)  # type: ignore[attr-defined]
    assert [entry.python for entry in entries() if not entry.place] == ["films"]


def test_names_in_files_and_in_python_are_the_same() -> None:
    """But where the key alone says too little: then its section is before it, or stands for it."""
    for cls in (Scene, particles.ParticleScene):
        for row, owner in all_keys(cls):
            key = row.what
            assert isinstance(key, Key)
            names = {row.last, f"{key.section}_{key.name}"}
            names |= {key.section} if owner is cls and key.section and key.name in ("", "lengths", "name") else set()
            assert row.field in names, key.place


@pytest.mark.parametrize("cls", [Scene, particles.ParticleScene])
def test_each_key_says_what_it_means_in_one_sentence_and_which_dimension_it_has(cls: type) -> None:
    for row, _ in all_keys(cls):
        key = row.what
        assert isinstance(key, Key)
        assert key.text.endswith(".")
        assert key.text[0].isupper() or key.text.startswith(("2", "dX/dt", '"'))
        assert all(re.fullmatch(r"(1|length|force|time)(\^\d)?", part) for part in re.split(r"[ /]", key.unit) if part)
        if row.default is not MISSING and row.default is not None and key.kind.fault is not None:
            assert key.kind.fault(row.default) is None


def test_one_key_is_told_by_any_of_its_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "range"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(
        "[contacts] range    in Python: range    scenes of many particles\n  A positive number; length."
    )
    assert "beyond this gap there is none" in said
    for name in ("[contacts] range", "contacts.range"):
        assert told(name) == said.strip()
    assert "gap" in told("contacts")
    assert told("lengths") == told("box.lengths")
    assert 'in Python: stress["xy"]' in told("xy")
    assert told("force").count("in Python:") == 4  # of two particles, of a push, on a fluid, and on one with grains
    assert "1e-09 by default" in told("rtol")


@pytest.mark.parametrize(("name", "meant"), [("rnage", "'range'"), ("shear", "'shear_rate'"), ("wal", "'wall'")])
def test_an_unknown_key_is_suggested(name: str, meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", name]) == 2
    assert f"there is no key {name!r}; did you mean {meant}?" in capsys.readouterr().err


def test_all_keys_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys"]) == 0
    said = capsys.readouterr().out
    assert all(entry.place in said for entry in entries())


def test_the_reference_page_is_what_the_declarations_say(capsys: pytest.CaptureFixture[str]) -> None:
    """Written by softdyn keys --markdown > .docs/keys.md."""
    assert main(["keys", "--markdown"]) == 0
    assert capsys.readouterr().out == page() + "\n"
    assert (ROOT / ".docs" / "keys.md").read_text(encoding="utf-8") == page() + "\n"


def scene_files() -> dict[str, dict[str, Any]]:
    """Content of the stock scenes and of those of the pages."""
    found = {name: tomllib.loads(path.read_text()) for name, path in particle_scenes().items()}
    for path in sorted((ROOT / ".docs").glob("*.md")):
        for number, text in enumerate(re.findall(r"```toml\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)):
            content = tomllib.loads(text)
            if "law" in content:
                found[f"{path.name} {number}"] = content
    return found


@pytest.mark.parametrize("name", list(scene_files()))
def test_scenes_are_valid_by_the_schema(name: str) -> None:
    validate = pytest.importorskip("fastjsonschema").compile(schema())
    validate(scene_files()[name])


@pytest.mark.parametrize(
    "change",
    [
        {"contacts": {"rnage": 0.5}},
        {"contacts": {"range": "0.5"}},
        {"contacts": {"gap": 0.0}},
        {"push": [{"force": [1, 0]}]},
        {"push": {"particles": [0], "force": [1, 0]}},
        {"flow": {"shear_rate": {"fil": "a.csv"}}},
        {"packing": {"kind": "square", "cells": [2, 2], "spacing": 2.0, "radii": 1.0}},
        {"until": None},
        {"accuracy": {"rtol": 1.0}},
        {"pair": {"h": 1.0}},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(change: dict[str, Any]) -> None:
    jsonschema = pytest.importorskip("fastjsonschema")
    validate = jsonschema.compile(schema())
    good = {**MANY, "particles": {"positions": [[0, 0], [3, 0]], "radii": 1.0}}
    validate(good)
    with pytest.raises(jsonschema.JsonSchemaException):
        validate({name: value for name, value in {**good, **change}.items() if value is not None})
    with pytest.raises(SceneError):
        softdyn.simulate(particle_scene_from({k: v for k, v in {**good, **change}.items() if v is not None}, Path()))


def test_the_schema_is_written(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out) == schema()


@pytest.mark.parametrize(
    ("data", "told_of"),
    [
        ({"contacts": {"reach": 1.0}}, "[contacts] unknown key 'reach'; it is range"),
        ({"pushes": []}, "unknown key 'pushes'; it is push"),
        ({"flow": {"drga": 1.0, "shear_rate": 0.0}}, "[flow] unknown key 'drga'; did you mean 'drag'?"),
        ({"push": [{"particles": [0], "forces": [1]}]}, "[[push]] 0 unknown key 'forces'; did you mean 'force'?"),
    ],
)
def test_faults_of_a_file_are_told_all_at_once(data: dict[str, Any], told_of: str) -> None:
    """Unknown keys with what is meant, what is missing, and values that are wrong by themselves."""
    bad = {"law": "rognon_gay", "until": {"t": 0.0}, "particles": {"positions": [[0.0]], "radii": 1.0}, **data}
    with pytest.raises(SceneError) as error:
        particle_scene_from(bad, Path())
    said = str(error.value)
    assert told_of in said
    assert "[parameters] is missing" in said
    assert "[until] t must be a positive number, not 0.0" in said


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: particles.ParticleScene(**MANY, reach=1.0), "ParticleScene: unknown key 'reach'; it is range"),
        (lambda: particles.Push([0], froce=[1]), "Push: unknown key 'froce'; did you mean 'force'"),  # type: ignore[call-arg]
        (lambda: particles.Packing(cuont=1), "Packing: unknown key 'cuont'; did you mean 'count'"),  # type: ignore[call-arg]
        (lambda: softdyn.Scene(**PAIR, until=1.0), "Scene: unknown key 'pair'.*'until'; it is until_t"),  # type: ignore[arg-type]
    ],
)
def test_an_unknown_keyword_is_suggested(make: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make()


def test_a_true_or_false_is_no_number() -> None:
    for where in ("gap", "range", "until_t", "rtol", "drag"):
        scene = particles.ParticleScene(
            "rognon_gay", {"E": 1.0, "eta": 1.0}, [[0.0, 0.0]], 1.0, **{"until_t": 1.0, where: True}
        )  # fmt: skip
        with pytest.raises(SceneError, match=rf"\] {where.removeprefix('until_')} must be .*not True"):
            softdyn.simulate(scene)


def test_a_packing_of_python_is_that_of_a_file() -> None:
    shared: dict[str, Any] = {"kind": "random", "count": 20, "dimension": 2, "fraction": 0.7, "radii": [1.0, 1.4]}
    read = particle_scene_from({**MANY, "packing": {**shared, "seed": 5}}, Path())
    made = particles.ParticleScene(
        law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, packing=particles.Packing(**shared, seed=5), until_t=1.0
    )
    assert np.array_equal(read.positions, made.positions)
    assert np.array_equal(read.radii, made.radii)
    assert read.box == made.box
    with pytest.raises(SceneError, match="two ways to say where the particles are"):
        particles.ParticleScene(
            law="rognon_gay", parameters={}, positions=[[0.0]], radii=1.0, packing=particles.Packing(**shared, seed=5)
        )


def test_particles_of_a_file_in_python(tmp_path: Path) -> None:
    (tmp_path / "some.csv").write_text("x,y,radius\n0,0,1\n3,0,2\n")
    made = particles.ParticleScene(law="rognon_gay", parameters={}, file=tmp_path / "some.csv", until_t=1.0)
    assert made.radii.tolist() == [1.0, 2.0]
    with pytest.raises(SceneError, match="radii and species belong in the file"):
        particles.ParticleScene(law="rognon_gay", parameters={}, file=tmp_path / "some.csv", radii=1.0)


@pytest.mark.slow
def test_arrays_in_a_scene_make_many_runs() -> None:
    given: dict[str, Any] = {**PAIR, "h": np.array([1.0, 2.0]), "force": 1e-2, "until_h": 0.1, "gaps": 3}
    del given["pair"]
    done: list[tuple[int, int]] = []
    many = softdyn.simulate(softdyn.Scene(**given), progress=lambda *now: done.append(now))
    assert np.array_equal(many.t, softdyn.simulate(**given).t)
    assert many.t.shape == (2, 3)


def test_constants_are_a_section_of_their_own() -> None:
    swinging = {**PAIR, "drive": {"force": "1e-2*cos(w*t)"}, "until": {"t": 1.0}}
    assert scene_from({**swinging, "constants": {"w": 1.0}}, Path()).constants == {"w": 1.0}
    with pytest.raises(SceneError, match="unknown key 'constants'; it is a key of the scene itself"):
        scene_from({**swinging, "drive": {**swinging["drive"], "constants": {"w": 1.0}}}, Path())  # type: ignore[dict-item]


TYPED = """
import numpy as np
import softdyn
from softdyn import particles

law, p = "rognon_gay", {"R": 1.0}
softdyn.simulate(law=law, parameters=p, h=1.0, force=1e-2, until_h=1e-3)
softdyn.simulate(law=law, parameters=p, h=np.geomspace(1, 2, 3), force=np.ones(3), until_h=1e-3)
softdyn.simulate("scene.toml", progress=print)
softdyn.simulate(law=law, parametrs=p, h=1.0)  # E: "parametrs"
softdyn.simulate(law=law, parameters=p, h="x")  # E: "str"
softdyn.Scene(law=law, parameters=p, h="x")  # E: "h"
particles.ParticleScene(law=law, parameters=p, packing=particles.Packing(count=3), range=0.5, stress={"xy": 1.0})
particles.ParticleScene(law=law, parameters=p, reach=0.5)  # E: "reach"
particles.ParticleScene(law=law, parameters=p, range="x")  # E: "range"
particles.ParticleScene(law=law, parameters=p, stress={"xz": 1.0})  # E: "xz"
particles.Push([0], froce=[1.0])  # E: "froce"
particles.Packing(cuont=1)  # E: "cuont"
"""


@pytest.mark.slow
def test_a_type_checker_sees_what_is_wrong(tmp_path: Path) -> None:
    """Names that there are not, and values of another kind; nothing else."""
    pytest.importorskip("mypy")
    (tmp_path / "typed.py").write_text(TYPED)
    (tmp_path / "mypy.ini").write_text("[mypy]\nfollow_imports = silent\nignore_missing_imports = true\n")
    command = [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", "typed.py"]
    around = {**os.environ, "MYPYPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=around, capture_output=True, text=True, check=False)
    found: dict[int, str] = {}
    for line in done.stdout.splitlines():
        if match := re.match(r"typed\.py:(\d+): error: (.*)", line):
            found.setdefault(int(match[1]), match[2])
    wanted = {n: line.partition("# E: ")[2] for n, line in enumerate(TYPED.splitlines(), 1) if "# E: " in line}
    assert set(found) == set(wanted), done.stdout + done.stderr
    assert all(wanted[n].strip('"') in found[n] for n in wanted), found


def test_a_section_that_a_scene_does_not_have_is_not_imported() -> None:
    code = (
        "import sys; from pathlib import Path; from softdyn.particles.files import particle_scene_from as read;"
        "read({'law': 'a', 'parameters': {}, 'until': {'t': 1}, 'particles': {'positions': [[0.0]], 'radii': 1.0}},"
        "Path()); assert 'softdyn.particles.packing' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_whatever_may_change_in_time_is_looked_through_for_constants() -> None:
    """Of every kind of section; words that are no expressions are none."""
    physics: dict[str, Any] = {"parameters": {"E": 1.0, "eta": 1.0}, "positions": [[0.0, 0.0]], "radii": 1.0}
    constants = dict.fromkeys("abcdef", 1.0)
    scene = particles.ParticleScene(
        "rognon_gay", **physics, until_t=1.0, constants=constants, shear_rate="a*t", stress={"xy": "b*t"},
        push=[particles.Push("f", ["c*t", 0.0])], hold=[particles.Hold([0], "x", ["d*t"])],
        wall=[particles.Wall([0, -2], [0, -1], velocity=[0, "e*t"])],
    )  # fmt: skip
    assert [value for value in driven_values(scene) if isinstance(value, str)] == ["e*t", "a*t", "b*t", "c*t", "d*t"]
    with pytest.raises(SceneError, match="constants: f does not appear in any expression"):
        require_used(scene)
