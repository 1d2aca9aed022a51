"""Files of gmsh: the same mesh from each format; what cannot be used is refused with the reason and the remedy."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from softdyn.errors import SceneError
from softdyn.fluid.mesh import facet_normals, volumes
from softdyn.fluid.mesh_file import read_mesh

meshio = pytest.importorskip("meshio")
DATA = Path(__file__).parent / "data"
CHANNEL = (DATA / "channel_2.2.msh").read_text()


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_a_plane_mesh_has_its_area_and_its_physical_groups(version: str) -> None:
    """A rectangle, 2 x 1, less a polygon of 12 sides in a circle of radius 0.2."""
    mesh = read_mesh(DATA / f"channel_{version}.msh")
    assert volumes(mesh).sum() == pytest.approx(2 - 6 * 0.2**2 * np.sin(np.pi / 6), rel=1e-12)
    outwards = {name: facet_normals(mesh.at, facets).sum(axis=0) for name, facets in mesh.boundaries.items()}
    assert set(outwards) == {"inlet", "outlet", "walls", "hole"}
    assert outwards["inlet"] == pytest.approx([-1, 0])
    assert outwards["outlet"] == pytest.approx([1, 0])
    assert outwards["hole"] == pytest.approx([0, 0], abs=1e-12)


def test_a_mesh_in_three_dimensions_has_its_volume_and_its_physical_groups() -> None:
    mesh = read_mesh(DATA / "box_4.1.msh")
    assert volumes(mesh).sum() == pytest.approx(2, rel=1e-12)
    assert facet_normals(mesh.at, mesh.boundaries["inlet"]).sum(axis=0) == pytest.approx([-1, 0, 0])
    assert np.linalg.norm(facet_normals(mesh.at, mesh.boundaries["walls"]), axis=1).sum() == pytest.approx(8)


@pytest.mark.parametrize("other", ["4.1", "binary"])
def test_text_and_binary_of_both_formats_are_the_same_mesh(other: str) -> None:
    mesh, again = read_mesh(DATA / "channel_2.2.msh"), read_mesh(DATA / f"channel_{other}.msh")
    assert again.at == pytest.approx(mesh.at, abs=1e-15)
    assert (mesh.corners == again.corners).all()
    assert all((facets == again.boundaries[name]).all() for name, facets in mesh.boundaries.items())


def changed(pattern: str, by: str) -> str:
    text, count = re.subn(pattern, by, CHANNEL, flags=re.MULTILINE)
    assert count, pattern
    return text


def without_names() -> str:
    """Physical groups by their numbers alone."""
    return changed(r"^\$PhysicalNames(.|\n)*\$EndPhysicalNames\n", "")


def test_groups_without_a_name_are_named_by_their_numbers(tmp_path: Path) -> None:
    (tmp_path / "a.msh").write_text(without_names())
    assert set(read_mesh(tmp_path / "a.msh").boundaries) == {"1", "2", "3", "4"}


WRONG = {
    "no mesh": ("a,b\n1,2\n", "no file of gmsh"),
    "empty": ("", "no file of gmsh"),
    "cut": (CHANNEL[: len(CHANNEL) // 2], r"has no section \$Elements|ends within \$"),
    "no elements": (CHANNEL[: CHANNEL.index("$Elements")], r"has no section \$Elements: it is not whole"),
    "version 9": (changed(r"^2\.2 0 8", "9.9 0 8"), "by meshio's words: Need mesh format"),
    "no number": (changed(r"^(1) (.*) 0$", r"\1 zero 0 0"), "cannot be read, by meshio's words"),
    "fewer nodes": (changed(r"\$Nodes\n99", "$Nodes\n90"), "by meshio's words: index"),
    "unknown kind": (changed(r"^(\d+) 2 2 (\d+ \d+ )", r"\1 77 2 \2"), "elements of a kind that there is not, 77"),
    "quadrilaterals": (changed(r"^(\d+) 2 2 (\d+ \d+ )(\d+) ", r"\1 3 2 \2\3 \3 "), "quad: only triangles and tetra"),
    "order 2": (changed(r"^(\d+) 1 2 (\d+ \d+ )(\d+) ", r"\1 8 2 \2\3 \3 "), "line3: .*Mesh.ElementOrder = 1"),
    "no groups": (changed(r"^(\d+) 1 2 \d+ ", r"\1 1 2 0 "), "no physical groups of curves, .* add them in gmsh"),
    "curves alone": (changed(r"^(\d+) 2 2 .*$", r"\1 15 2 0 1 1"), "neither triangles nor tetrahedra"),
    "unnamed walls": (changed(r"^(7) 1 2 \d ", r"\1 1 2 0 "), r"1 facet of the boundary without a name, at \("),
    "no such facets": (changed(r"^(\d+) 1 2 3 ", r"\1 1 2 1 "), "no facet has the name 'walls': leave it out"),
    "bent": (changed(r"^(7 \S+ \S+) 0$", r"\1 0.25"), "a surface in three dimensions"),
    "nan": (changed(r"^(7) (\S+) (\S+) 0$", r"\1 nan \3 0"), "point 6 is not finite"),
}


@pytest.mark.parametrize("what", list(WRONG))
def test_files_that_are_wrong_are_refused(tmp_path: Path, what: str) -> None:
    text, said = WRONG[what]
    (tmp_path / "wrong.msh").write_text(text)
    with pytest.raises(SceneError, match=said):
        read_mesh(tmp_path / "wrong.msh")


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_no_file_that_is_cut_anywhere_is_read(tmp_path: Path, version: str) -> None:
    whole = (DATA / f"channel_{version}.msh").read_bytes()
    for end in range(0, len(whole) - len("$EndElements\n"), 397):
        (tmp_path / "cut.msh").write_bytes(whole[:end])
        with pytest.raises(SceneError):
            read_mesh(tmp_path / "cut.msh")


def test_no_random_change_of_a_file_ends_in_another_error(tmp_path: Path) -> None:
    """Bytes in the sections of nodes and elements are replaced; a mesh that still can be used may be read."""
    rng = np.random.default_rng(5)
    for version in ("2.2", "4.1"):
        whole = bytearray((DATA / f"channel_{version}.msh").read_bytes())
        for _ in range(60):
            torn = bytearray(whole)
            for k in rng.integers(20, len(torn), 3):
                torn[k] = int(rng.choice(list(b"0123456789- \n$abc\xff")))
            (tmp_path / "torn.msh").write_bytes(bytes(torn))
            with suppress(SceneError):
                assert volumes(read_mesh(tmp_path / "torn.msh")).min() > 0


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"cannot read the mesh .*none.msh: No such file"):
        read_mesh(tmp_path / "none.msh")
