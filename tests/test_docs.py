"""What README and pages show is what works: Python runs, page by page; scenes are read; commands are there."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest

from softdyn.cli import _parser
from softdyn.fluid.boundary_keys import periodic_pairs
from softdyn.fluid.conditions import conditions_of
from softdyn.fluid.fluid_scene import check_fluid, fluid_scene_from
from softdyn.fluid.mesh_section import made_mesh
from softdyn.fluid.numbering import nodes_of
from softdyn.particles.files import particle_scene_from
from softdyn.particles.particle_scene import check
from softdyn.scene.pair_scene import check_scene, scene_from
from softdyn.scene.reading import is_fluid_scene, is_particle_scene, is_suspension_scene
from softdyn.suspension.suspension_scene import check_suspension, suspension_scene_from

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / ".docs").glob("*.md"))]
NAMES = [str(path.relative_to(ROOT)) for path in PAGES]


def snippets(page: str, language: str) -> list[str]:
    """Blocks of a page; those marked ``py`` instead of ``python`` are parts, which do not run by themselves."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^ *```{language}\n(.*?)^ *```$", text, flags=re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("page", [name for name in NAMES if snippets(name, "python")])
def test_the_python_of_a_page_runs_as_one_program(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Typed in by somebody in a folder of their own."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for snippet in snippets(page, "python"):
        exec(compile(snippet, page, "exec"), names)
    results = [one for one in names.values() if hasattr(one, "stats")]
    assert not [result.stats["warnings"] for result in results if result.stats.get("warnings")]
    for picture in tmp_path.glob("*.png"):
        assert picture.stat().st_size > 10_000


def scenes(page: str) -> list[dict[str, Any]]:
    """Scenes of a page; a block without a law or a fluid is what the scene before may say instead."""
    found: list[dict[str, Any]] = []
    for data in map(tomllib.loads, snippets(page, "toml")):
        found.append(data if {"law", "mesh", "chains", "inertia"} & set(data) else {**found[-1], **data})
    return found


@pytest.mark.parametrize("page", [name for name in NAMES if snippets(name, "toml")])
def test_the_scenes_of_a_page_are_read(page: str, tmp_path: Path) -> None:
    (tmp_path / "forces.py").write_text("\n".join(snippets(page, "python")))  # as a page may call its file
    for data in scenes(page):
        if is_suspension_scene(data):
            suspension = suspension_scene_from(data, tmp_path)
            check_suspension(suspension)
            made_mesh(suspension.mesh)
        elif is_particle_scene(data):
            packed = data.get("packing", {})
            fewer = {"packing": {**packed, "count": min(100, packed.get("count", 100))}} if packed else {}
            check(particle_scene_from({**data, **fewer}, tmp_path))
        elif is_fluid_scene(data):
            scene = fluid_scene_from(data, tmp_path)
            check_fluid(scene)
            mesh, pairs = made_mesh(scene.mesh), periodic_pairs(scene.boundary)
            conditions_of(scene.boundary, mesh, nodes_of(mesh, 2, pairs), nodes_of(mesh, 1, pairs), scene.constants)
        else:
            check_scene(scene_from(data, tmp_path))


def commands(page: str) -> list[str]:
    text = "\n".join(snippets(page, "sh")).replace("\\\n", " ")
    # what stands after && or ; is a command of its own
    lines = [part.strip() for line in text.splitlines() for part in re.split(r"&&|;", re.split(r"\s#", line)[0])]
    return [line.split(" > ")[0] for line in lines if line.startswith("softdyn ")]


@pytest.mark.parametrize("page", [name for name in NAMES if commands(name)])
def test_the_commands_of_a_page_are_there(page: str) -> None:
    """With their options: the command line takes them."""
    for command in commands(page):
        assert _parser().parse_args(shlex.split(command)[1:]) is not None


@pytest.mark.parametrize("page", NAMES)
def test_links_within_the_project_lead_somewhere(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:|#|mailto:)([^)#]+)", text):
        assert ((ROOT / page).parent / target).exists(), f"{page} links to {target}"


def test_the_readme_is_short_and_has_the_two_commands() -> None:
    """One screen, then less than two more."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 140
    assert len(re.findall(r"^pip install .*&& ", text, flags=re.MULTILINE)) == 2


def test_no_page_is_left_out_of_the_readme_or_the_contents() -> None:
    """Every page is in the site's table of contents."""
    contents = (ROOT / ".docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / ".docs").glob("*.md"):
        assert page.stem == "index" or re.search(rf"^{page.stem}$", contents, flags=re.MULTILINE), page.name
