"""Meshes from files of gmsh: triangles or tetrahedra of order 1, physical groups as names of the boundary."""

from __future__ import annotations

import io
import re
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.mesh import Mesh, mesh_of

Ints = NDArray[np.int64]

#: Elements by dimension, and the facets of each.
ELEMENTS = {2: "triangle", 3: "tetra"}
FACET_KINDS = {2: "line", 3: "triangle"}
#: What a file may hold besides: it says nothing of the flow.
PASSED_OVER = ("vertex",)
#: Sections without which there is no mesh.
SECTIONS = ("MeshFormat", "Nodes", "Elements")
#: How far from its plane a point of a plane mesh may be, over the mesh's size.
OFF_PLANE = 1e-9


def read_mesh(path: str | Path) -> Mesh:
    """Read a file of gmsh.

    Parameters
    ----------
    path : str or Path
        Format 2.2, 4.0 or 4.1, text or binary.

    Raises
    ------
    SceneError
        If meshio is not installed; if the file cannot be read, ends early, or is none of gmsh; if it has other elements
        than triangles or tetrahedra of order 1, or no physical groups; if the mesh cannot be used, see
        :func:`softdyn.fluid.mesh.mesh_of`.
    """
    path = Path(path)
    where = f"mesh {path.name}"
    read = _read(path, where)
    kinds = {block.type for block in read.cells}
    d = 3 if ELEMENTS[3] in kinds else 2
    _require_kinds(kinds, d, where)
    points = np.asarray(read.points, dtype=float)
    if d == 2:
        used = np.unique(_cells(read, ELEMENTS[2]))
        if used.size and np.ptp(points[used, 2]) > OFF_PLANE * np.ptp(points[used], axis=0).max():
            raise SceneError(
                f"{where} is a surface in three dimensions: a plane mesh has one z for all points; a mesh in three "
                "dimensions has tetrahedra"
            )
        points = points[:, :2]
    return mesh_of(points, _cells(read, ELEMENTS[d]), _groups(read, d, where), where)


def _read(path: Path, where: str) -> Any:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise SceneError(f"cannot read the mesh {path}: {error.strerror}") from None
    if not raw.lstrip().startswith((b"$MeshFormat", b"$Comments")):
        raise SceneError(f"{where} is no file of gmsh, which starts with $MeshFormat: save it as .msh")
    for section in SECTIONS:
        if not re.search(rb"^\$%b\s" % section.encode(), raw, re.MULTILINE):
            raise SceneError(f"{where} has no section ${section}: it is not whole, or has no mesh; save it anew")
        if b"$End" + section.encode() not in raw:
            raise SceneError(f"{where} ends within ${section}: it is not whole; save it anew")
    try:
        from meshio import gmsh
    except ImportError:
        raise SceneError(f'{where}: files of gmsh are read by meshio: pip install "softdyn[fluid]"') from None
    try:
        with warnings.catch_warnings(), redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            return gmsh.read(path)
    except Exception as error:
        raise SceneError(_unread(where, error)) from None


def _unread(where: str, error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"{where} has elements of a kind that there is not, {error.args[0]}: save it anew, by gmsh"
    if "cell data" in str(error).lower():
        return (
            f"{where} has elements outside of all physical groups: put the fluid itself into one, too, or save the "
            "groups alone (Mesh.SaveAll = 0)"
        )
    words = str(error).strip() or type(error).__name__
    return f"{where} cannot be read, by meshio's words: {words}; save it anew, as format 2.2 or 4.1"


def _require_kinds(kinds: set[str], d: int, where: str) -> None:
    allowed = {*ELEMENTS.values(), *FACET_KINDS.values(), *PASSED_OVER}
    other = sorted(kinds - allowed)
    if other:
        curved = [kind for kind in other if re.fullmatch(r"(line|triangle|tetra)\d+", kind)]
        remedy = (
            "save the mesh with elements of order 1 (Mesh.ElementOrder = 1): nodes of order 2 are made from these"
            if curved
            else "only triangles and tetrahedra are taken (in gmsh, leave out Recombine)"
        )
        raise SceneError(f"{where} has elements of the kind {', '.join(curved or other)}: {remedy}")
    if ELEMENTS[d] not in kinds:
        raise SceneError(f"{where} has neither triangles nor tetrahedra, only {', '.join(sorted(kinds)) or 'nothing'}")


def _cells(read: Any, kind: str) -> Ints:
    found = [np.asarray(block.data, dtype=np.int64) for block in read.cells if block.type == kind]
    return np.concatenate(found) if found else np.empty((0, 0), dtype=np.int64)


def _groups(read: Any, d: int, where: str) -> dict[str, Ints]:
    """Facets of each physical group of the boundary."""
    tags = read.cell_data.get("gmsh:physical")
    blocks = [] if tags is None else list(zip(read.cells, tags, strict=True))
    facets = [(block.data, np.asarray(tag)) for block, tag in blocks if block.type == FACET_KINDS[d]]
    names = {int(tag): str(name) for name, (tag, dimension) in read.field_data.items() if dimension == d - 1}
    if not any(tag.any() for _, tag in facets):
        what = "curves" if d == 2 else "surfaces"
        raise SceneError(
            f"{where} has no physical groups of {what}, which name the parts of the boundary: add them in gmsh, and "
            "save the groups alone (Mesh.SaveAll = 0)"
        )
    for _, tag in facets:
        names |= {int(number): str(number) for number in np.unique(tag) if number and int(number) not in names}
    return {
        name: np.concatenate([np.asarray(block, dtype=np.int64)[tag == number] for block, tag in facets])
        for number, name in names.items()
    }
