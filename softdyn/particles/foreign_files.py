"""Particles from the files of other programs: LAMMPS data and dumps, (extended) XYZ, GSD, points of VTK.

The last frame of a trajectory is taken. Where every z is 0 the scene is of two dimensions. Types and kinds become
species if there are several. Files without sizes leave the radii to the scene. Lengths are those of the file.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError

Array = NDArray[np.float64]

#: Packages that read files that are no text, and what installs them.
PACKAGES = {"gsd.hoomd": "formats", "meshio": "fluid"}
#: Columns of the section Atoms of a LAMMPS data file, by the style of its atoms.
STYLES = {
    "atomic": "id type x y z",
    "charge": "id type q x y z",
    "bond": "id molecule type x y z",
    "angle": "id molecule type x y z",
    "molecular": "id molecule type x y z",
    "full": "id molecule type q x y z",
    "sphere": "id type diameter density x y z",
    "bpm/sphere": "id molecule type diameter density x y z",
}
#: Words at the start of a section of a LAMMPS data file; only that of the atoms is read.
SECTION = re.compile(r"^[A-Z][A-Za-z ]*")
#: What a comment of extended XYZ says: name=value, the value in quotes if it has spaces.
SAID = re.compile(r"""(\w+)\s*=\s*(?:"([^"]*)"|(\S+))""")


@dataclass(frozen=True)
class Found:
    """What a file says of particles.

    Attributes
    ----------
    x : array, shape (N, 3)
    radii : array, shape (N,), or None
    kinds : sequence of str, or None
    cell : array, shape (3, 3), or None
        Edges of the periodic box as columns; None without a box.
    periodic : tuple of three bool
    flat : bool or None
        Whether there are two dimensions; None if the file does not tell.
    """

    x: Array
    radii: Array | None = None
    kinds: Sequence[str] | None = None
    cell: Array | None = None
    periodic: tuple[bool, ...] = (True, True, True)
    flat: bool | None = None


def reader_of(path: Path) -> Callable[[Path], Found] | None:
    """What reads a file of another program, by its ending or by the start of its name; None for one of softdyn's."""
    return READERS.get(path.suffix.lower()) or {"data": _lammps_data, "dump": _lammps_dump}.get(path.name.split(".")[0])


def read_foreign(path: Path, read: Callable[[Path], Found]) -> dict[str, Any]:
    """Positions, and radii, species, box and tilt as far as a file has them, as fields of a scene.

    Parameters
    ----------
    path : Path
    read : callable
        Of :func:`reader_of`.

    Raises
    ------
    SceneError
        Naming the file, the line at fault if it is a text, and what is wrong.
    """
    try:
        found = read(path)
    except (OSError, UnicodeDecodeError) as error:
        raise SceneError(f"cannot read {path}: {error}") from None
    if not len(found.x):
        raise SceneError(f"{path}: there is no particle")
    if not np.isfinite(found.x).all():
        raise SceneError(f"{path}: the position of particle {np.argmin(np.isfinite(found.x).all(axis=1))} is no number")
    flat = bool(np.all(found.x[:, 2] == 0)) if found.flat is None else found.flat
    d = 2 if flat else 3
    placed: dict[str, Any] = {"positions": found.x[:, :d]}
    if found.radii is not None:
        placed["radii"] = found.radii
    if found.kinds is not None and len(set(found.kinds)) > 1:
        placed["species"] = list(found.kinds)
    if found.cell is not None and any(found.periodic[:d]):
        placed |= _box(found.cell[:d, :d], found.periodic[:d], path)
    return placed


def _box(cell: Array, periodic: Sequence[bool], path: Path) -> dict[str, Any]:
    """Box and tilt: only the second edge may lean, along the first axis."""
    edges = np.diag(cell)
    leaning = cell - np.diag(edges)
    tilt, leaning[0, 1] = float(leaning[0, 1]), 0.0
    if not (edges > 0).all() or np.abs(leaning).max() > 1e-12 * edges.max():
        raise SceneError(
            f"{path}: the edges of the box are {cell.T.tolist()}; the first must lie along x, the second in the plane "
            "of x and y, and the third along z"
        )
    box = [float(edge) if repeats else None for edge, repeats in zip(edges, periodic, strict=True)]
    return {"box": box, "tilt": tilt} if tilt else {"box": box}


# --------------------------------------------------------------------------------------------------------------- texts


def _lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8-sig").splitlines()


def _fault(path: Path, number: int, words: str) -> SceneError:
    return SceneError(f"{path}, line {number + 1}: {words}")


def _columns(path: Path, lines: Sequence[str], first: int, count: int, names: Sequence[str]) -> dict[str, list[str]]:
    """Cells of ``count`` lines from ``first`` on, by the names of their columns; further columns are left."""
    rows = [line.split() for line in lines[first : first + count]]
    for number, row in enumerate(rows):
        if len(row) < len(names):
            raise _fault(path, first + number, f"{len(row)} columns, where {len(names)} are meant: {' '.join(names)}")
    if len(rows) < count:
        raise _fault(path, len(lines) - 1, f"the file ends after {len(rows)} of {count} particles")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _numbers(path: Path, first: int, cells: Sequence[str]) -> Array:
    try:
        return np.array(cells, dtype=float)
    except ValueError:
        for number, cell in enumerate(cells):
            _number(path, first + number, cell)
        raise


def _number(path: Path, line: int, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise _fault(path, line, f"{cell!r} is no number") from None


def _count(path: Path, line: int, cell: str) -> int:
    if not cell.isdecimal():
        raise _fault(path, line, f"the number of particles is meant, not {cell!r}")
    return int(cell)


def _sizes(path: Path, first: int, columns: Mapping[str, list[str]]) -> Array | None:
    """Radii, if there is a column of them or of diameters."""
    if "radius" in columns:
        return _numbers(path, first, columns["radius"])
    return _numbers(path, first, columns["diameter"]) / 2 if "diameter" in columns else None


def _xyz(path: Path) -> Found:
    """The last frame of a file of XYZ, extended or not."""
    lines = _lines(path)
    at, count = 0, 0
    frames = list(_xyz_frames(path, lines))
    if not frames:
        return Found(np.empty((0, 3)))
    at, count = frames[-1]
    said = {name: quoted or bare for name, quoted, bare in SAID.findall(lines[at + 1])}
    names = _xyz_names(path, at + 1, said.get("Properties", "species:S:1:pos:R:3"))
    columns = _columns(path, lines, at + 2, count, names)
    if "pos0" not in columns or "pos2" not in columns:
        raise _fault(path, at + 1, "Properties has no pos:R:3")
    x = np.column_stack([_numbers(path, at + 2, columns[f"pos{k}"]) for k in range(3)])
    cell, periodic = None, (True, True, True)
    if "Lattice" in said:
        edges = [_number(path, at + 1, cell) for cell in said["Lattice"].split()]
        if len(edges) != 9:
            raise _fault(path, at + 1, f"Lattice has {len(edges)} numbers, not 9")
        cell = np.array(edges).reshape(3, 3).T
    if "pbc" in said:
        repeats = [word.upper() in ("T", "TRUE", "1") for word in said["pbc"].split()]
        if len(repeats) != 3:
            raise _fault(path, at + 1, f"pbc has {len(repeats)} values, not 3")
        periodic = (repeats[0], repeats[1], repeats[2])
    return Found(x, _sizes(path, at + 2, columns), columns.get("species"), cell, periodic)


def _xyz_frames(path: Path, lines: Sequence[str]) -> Iterator[tuple[int, int]]:
    """First line and number of particles of each frame."""
    at = 0
    while at < len(lines) and lines[at].strip():
        count = _count(path, at, lines[at].strip())
        if at + 2 + count > len(lines):
            raise _fault(path, at, f"{count} particles are announced, and {max(0, len(lines) - at - 2)} lines follow")
        yield at, count
        at += 2 + count


def _xyz_names(path: Path, line: int, properties: str) -> list[str]:
    """Names of the columns: pos0, pos1, pos2 of pos:R:3."""
    parts = properties.split(":")
    if len(parts) % 3 or not all(width.isdecimal() for width in parts[2::3]):
        raise _fault(path, line, f"Properties is name:kind:columns, again and again, not {properties!r}")
    names = []
    for name, width in zip(parts[0::3], parts[2::3], strict=True):
        names += [name] if width == "1" else [f"{name}{k}" for k in range(int(width))]
    return names


def _lammps_data(path: Path) -> Found:
    """The atoms of a LAMMPS data file, in a box that is periodic, as LAMMPS takes it if it is told nothing else."""
    lines = _lines(path)
    count, bounds, leans, section = None, {}, (0.0, 0.0, 0.0), None
    for number, line in enumerate(lines[1:], start=1):
        words = line.partition("#")[0].split()
        if SECTION.match(line):
            if words == ["Atoms"]:
                section = number
                break
            continue
        if words[1:] == ["atoms"]:
            count = _count(path, number, words[0])
        elif len(words) == 4 and words[2:] in (["xlo", "xhi"], ["ylo", "yhi"], ["zlo", "zhi"]):
            bounds[words[2][0]] = [_number(path, number, word) for word in words[:2]]
        elif words[3:] == ["xy", "xz", "yz"]:
            xy, xz, yz = (_number(path, number, word) for word in words[:3])
            leans = (xy, xz, yz)
    if count is None or section is None or set(bounds) != set("xyz"):
        raise SceneError(
            f"{path}: a LAMMPS data file has lines 'N atoms', 'LOW HIGH xlo xhi', also of y and z, and a section Atoms"
        )
    style = lines[section].partition("#")[2].strip()
    if style not in STYLES:
        raise _fault(
            path, section, f"the style of the atoms is {style!r}; write it after the heading, as 'Atoms # sphere': one "
            f"of {', '.join(STYLES)}",
        )  # fmt: skip
    first = section + 2 if section + 1 < len(lines) and not lines[section + 1].strip() else section + 1
    columns = _columns(path, lines, first, count, STYLES[style].split())
    order = np.argsort(_numbers(path, first, columns["id"]), kind="stable")
    x = np.column_stack([_numbers(path, first, columns[axis]) for axis in "xyz"])
    radii = _sizes(path, first, columns)
    kinds = [columns["type"][k] for k in order]
    cell = _triclinic([bounds[axis][1] - bounds[axis][0] for axis in "xyz"], leans)
    return Found(x[order], None if radii is None else radii[order], kinds, cell)


def _triclinic(edges: Sequence[float], leans: Sequence[float]) -> Array:
    xy, xz, yz = leans
    return np.array([[edges[0], xy, xz], [0.0, edges[1], yz], [0.0, 0.0, edges[2]]])


def _lammps_dump(path: Path) -> Found:
    """The last frame of a LAMMPS dump in text."""
    lines = _lines(path)
    starts = [number for number, line in enumerate(lines) if line.startswith("ITEM: TIMESTEP")]
    if not starts:
        raise _fault(path, 0, "a LAMMPS dump starts with 'ITEM: TIMESTEP'")
    items = {
        " ".join(line.split()[1:]): number
        for number, line in enumerate(lines[starts[-1] :], start=starts[-1])
        if line.startswith("ITEM:")
    }
    bounds = next(((title, at) for title, at in items.items() if title.startswith("BOX BOUNDS")), None)
    atoms = next(((title, at) for title, at in items.items() if title.startswith("ATOMS")), None)
    if bounds is None or atoms is None or "NUMBER OF ATOMS" not in items or items["NUMBER OF ATOMS"] + 1 == len(lines):
        raise _fault(path, starts[-1], "the last frame has no NUMBER OF ATOMS, BOX BOUNDS or ATOMS: was it cut off?")
    at = items["NUMBER OF ATOMS"] + 1
    count = _count(path, at, lines[at].strip())
    low, cell, periodic = _dump_box(path, lines, *bounds)
    first = atoms[1] + 1
    columns = _columns(path, lines, first, count, atoms[0].split()[1:])
    x = None
    for suffix in ("u", "", "s", "su"):
        if all(axis + suffix in columns for axis in "xyz"):
            x = np.column_stack([_numbers(path, first, columns[axis + suffix]) for axis in "xyz"])
            x = low + x @ cell.T if "s" in suffix else x
            break
    if x is None:
        raise _fault(path, atoms[1], "the dump has no columns x y z, xu yu zu, xs ys zs or xsu ysu zsu")
    radii, kinds = _sizes(path, first, columns), columns.get("type")
    order = np.argsort(_numbers(path, first, columns["id"]), kind="stable") if "id" in columns else np.arange(count)
    return Found(
        x[order],
        None if radii is None else radii[order],
        None if kinds is None else [kinds[k] for k in order],
        cell,
        periodic,
    )


def _dump_box(path: Path, lines: Sequence[str], title: str, at: int) -> tuple[Array, Array, tuple[bool, ...]]:
    """Corner, edges and periodicity; of a box that leans, the bounds written are those around it."""
    words = title.split()[2:]
    if "abc" in words:
        raise _fault(path, at, "a box of general triclinic form is not read: dump it without 'triclinic/general yes'")
    width = 3 if words[:3] == ["xy", "xz", "yz"] else 2
    rows = [
        [_number(path, at + 1 + k, cell) for cell in line.split()[:width]]
        for k, line in enumerate(lines[at + 1 : at + 4])
    ]
    if [len(row) for row in rows] != [width] * 3:
        raise _fault(path, at, f"the box needs three lines of {width} numbers")
    low, high = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    xy, xz, yz = (row[2] for row in rows) if width == 3 else (0.0, 0.0, 0.0)
    low[0] -= min(0.0, xy, xz, xy + xz)
    high[0] -= max(0.0, xy, xz, xy + xz)
    low[1] -= min(0.0, yz)
    high[1] -= max(0.0, yz)
    ends = words[3:] if width == 3 else words
    periodic = tuple(word == "pp" for word in ends) if len(ends) == 3 else (True, True, True)
    return low, _triclinic((high - low).tolist(), (xy, xz, yz)), periodic


# ------------------------------------------------------------------------------------------------------- other formats


def _package(name: str, path: Path) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise SceneError(
            f"reading {path} needs the package {name.partition('.')[0]}: pip install 'softdyn[{PACKAGES[name]}]'"
        ) from None


def _gsd(path: Path) -> Found:
    """The last frame of a trajectory of HOOMD, or of one that softdyn has written for OVITO."""
    hoomd = _package("gsd.hoomd", path)
    path.stat()  # what the system says of a file that is not there
    try:
        with hoomd.open(str(path), "r") as frames:
            if not len(frames):
                return Found(np.empty((0, 3)))
            frame = frames[-1]
    except (OSError, RuntimeError, ValueError) as error:
        raise SceneError(f"cannot read {path}: it is no GSD file of HOOMD's schema ({error})") from None
    points, box = frame.particles, frame.configuration.box
    cell = None
    if box is not None and box[0] > 0:
        edges = np.array(box[:3], dtype=float)
        edges[2] = edges[2] or 1.0
        cell = _triclinic(edges.tolist(), (box[3] * edges[1], box[4] * edges[2], box[5] * edges[2]))
    kinds = None if points.types is None else [points.types[k] for k in points.typeid]
    flat = frame.configuration.dimensions == 2
    return Found(np.asarray(points.position, float), np.asarray(points.diameter, float) / 2, kinds, cell, flat=flat)


def _vtk(path: Path) -> Found:
    """Points of a file of VTK, with values called radius or diameter."""
    meshio = _package("meshio", path)
    path.stat()
    try:
        mesh = meshio.read(path)
    except (meshio.ReadError, ValueError, KeyError, IndexError, SystemExit) as error:
        raise SceneError(f"cannot read {path}: it is no VTK file that meshio reads ({error})") from None
    x = np.zeros((len(mesh.points), 3))
    x[:, : mesh.points.shape[1]] = mesh.points
    values = {name.lower(): np.asarray(value, dtype=float) for name, value in mesh.point_data.items()}
    radii = values.get("radius", values["diameter"] / 2 if "diameter" in values else None)
    return Found(x, radii)


READERS: dict[str, Callable[[Path], Found]] = {
    ".xyz": _xyz,
    ".extxyz": _xyz,
    ".data": _lammps_data,
    ".lmp": _lammps_data,
    ".dump": _lammps_dump,
    ".lammpstrj": _lammps_dump,
    ".gsd": _gsd,
    ".vtk": _vtk,
    ".vtu": _vtk,
}
