"""Results as files for programs that show particles: GSD for OVITO, VTK for ParaView.

A result keeps positions as they are, never wrapped. Here they are wrapped into the periodic box, in the least tilted
cell of its lattice, so that a picture shows one box; along axes that are not periodic, the box is one that holds all
frames twice over, so that no pair is nearer around it. The .npz holds everything, these files what is shown of it.
"""

from __future__ import annotations

import importlib
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.observables import is_periodic, is_sheared, strain
from softdyn.results.whole_files import folder_whole, written_whole
from softdyn.results.writers import require_writer

if TYPE_CHECKING:
    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]
#: Values of points or lines by their names; of vectors, the three components.
Values = dict[str, NDArray[Any] | tuple[Array, ...]]

LINE = 3  # VTK's number for the type of a cell


@dataclass(frozen=True)
class Boxed:
    """Positions of one frame within a box, in three dimensions.

    Attributes
    ----------
    cell : array, shape (3, 3)
        Edges of the box as columns, upper triangular.
    corner : array, shape (3,)
    x : array, shape (N, 3)
        Within the box along its periodic axes.
    image : array of int, shape (N, 3)
        A particle's position in the result is x + cell @ image.
    """

    cell: Array
    corner: Array
    x: Array
    image: NDArray[np.int64]


def boxed(result: ParticleResult, frame: int) -> Boxed:
    """Positions of a frame, wrapped into the box."""
    d = result.x.shape[2]
    periodic = np.append(np.isfinite(result.box), np.zeros(3 - d, bool))
    every = padded(result.x.reshape(-1, d))
    low, high = every.min(axis=0), every.max(axis=0)
    lengths = 2 * (high - low) + 4 * float(result.radii.max())
    if d == 2:
        lengths[2] = float(result.depth)
    cell = np.diag(np.where(periodic, 0.0, lengths))
    cell[:d, :d] += result.cell[frame]
    if periodic[:2].all():
        cell[0, 1] -= cell[0, 0] * np.round(cell[0, 1] / cell[0, 0])
    corner = np.where(periodic, 0.0, (low + high - lengths) / 2)
    x = padded(result.x[frame])
    turns = np.floor(np.linalg.solve(cell, (x - corner).T).T)
    image = np.where(periodic, turns, 0.0)
    return Boxed(cell, corner, x - image @ cell.T, image.astype(np.int64))


def write(result: ParticleResult, path: Path) -> None:
    """Write a file in the format that its ending says.

    Raises
    ------
    SceneError
        If there is no such format, its package is not installed, or the file cannot be written.
    """
    require_writer(path)
    (write_gsd if path.suffix == ".gsd" else write_vtk)(result, path)


def turning(result: ParticleResult, frame: int) -> Array:
    """Angular velocities in three dimensions, shape (N, 3): in the plane there is the one about z."""
    spin: Array = result.spin[frame]
    return np.pad(spin, ((0, 0), (3 - spin.shape[1], 0)))


def padded(vectors: Array) -> Array:
    """Give vectors three dimensions."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def write_gsd(result: ParticleResult, path: Path) -> None:
    """Write a trajectory in the schema of HOOMD: particles with velocities, contacts of two particles as bonds.

    Lengths and velocities of particles are single precision there, and positions are counted from the middle of the
    box. ``log`` holds the time ``t``, the ``stress`` and, of a sheared box, the ``strain``; of each bond, in double
    precision, ``bonds/gap``, ``bonds/deflection`` and ``bonds/force``; with tangential motion ``bonds/tangential``,
    the force from the bond's first particle to its second, and ``particles/spin``. Contacts with walls are in the .npz
    alone.

    Raises
    ------
    SceneError
        If the package gsd is not installed, or the file cannot be written.
    """
    hoomd = require_writer(path)
    count, d = result.x.shape[1:]
    strains = strain(result) if is_sheared(result) else None
    with written_whole(path) as temporary, hoomd.open(str(temporary), "w") as trajectory:
        for number in range(len(result)):
            placed = boxed(result, number)
            contacts = result.contacts(number)
            pair = contacts["j"] < count
            lengths = np.diag(placed.cell)
            frame = hoomd.Frame()
            frame.configuration.step = number
            frame.configuration.dimensions = max(2, d)
            frame.configuration.box = [
                *lengths,
                *(placed.cell[a, b] / lengths[b] for a, b in ((0, 1), (0, 2), (1, 2))),
            ]
            frame.particles.N = count
            frame.particles.types = [name or "particle" for name in result.species_names.tolist()]
            frame.particles.typeid = result.species
            frame.particles.diameter = 2 * result.radii
            frame.particles.position = placed.x - placed.corner - placed.cell.sum(axis=1) / 2
            frame.particles.velocity = padded(result.v[number])
            frame.particles.image = placed.image
            frame.bonds.N = int(pair.sum())
            frame.bonds.types = ["contact"]
            frame.bonds.typeid = np.zeros(frame.bonds.N, dtype=np.uint32)
            frame.bonds.group = np.column_stack([contacts["i"][pair], contacts["j"][pair]])
            frame.log = {
                "t": result.t[number : number + 1],
                "stress": result.stress[number],
                "bonds/gap": contacts["h"][pair],
                "bonds/deflection": contacts["delta"][pair],
                "bonds/force": contacts["F"][pair],
            }
            if "T" in contacts:
                frame.log["bonds/tangential"] = padded(contacts["T"][pair])
                frame.log["particles/spin"] = turning(result, number)
            if strains is not None:
                frame.log["strain"] = strains[number : number + 1]
            trajectory.append(frame)


def write_vtk(result: ParticleResult, path: Path) -> None:
    """Write a .pvd, which names for each frame the files of its particles and contacts, in a folder of the same name.

    Particles are points with ``radius``, ``species`` and ``velocity``; contacts lines between centres, or from a centre
    to the wall, with ``gap``, ``deflection`` and ``force``; the edges of a periodic box are lines, too. With tangential
    motion there are ``spin`` and the ``tangential`` force. In the .pvd these are the parts 0, 1 and 2. A frame without
    contacts has no file of them.

    Raises
    ------
    SceneError
        If the package pyevtk is not installed, or a file cannot be written.
    """
    hl = require_writer(path)
    group = importlib.import_module("pyevtk.vtk").VtkGroup
    with (
        written_whole(path) as temporary,
        folder_whole(path.with_suffix("").absolute()) as (folder, final),
        ExitStack() as opened,
    ):
        collection = group(str(temporary.absolute().with_suffix("")))
        opened.callback(collection.xml.stream.close)
        digits = len(str(len(result) - 1))

        def add(file: str, t: float, part: str) -> None:
            collection.addFile(str(final / Path(file).name), t, part=part)

        for number in range(len(result)):
            t = float(result.t[number])
            placed = boxed(result, number)
            name = str(folder / f"particles_{number:0{digits}}")
            data: Values = {"radius": result.radii, "species": result.species}
            data["velocity"] = _columns(padded(result.v[number]))
            contacts = result.contacts(number)
            values: Values = {"gap": contacts["h"], "deflection": contacts["delta"], "force": contacts["F"]}
            if "T" in contacts:
                data["spin"] = _columns(turning(result, number))
                values["tangential"] = _columns(padded(contacts["T"]))
            add(hl.pointsToVTK(name, *_columns(placed.x), data=data), t, "0")
            if len(contacts["h"]):
                name = str(folder / f"contacts_{number:0{digits}}")
                add(_write_lines(hl, name, *lines(result, placed, contacts), values), t, "1")
            if is_periodic(result):
                name = str(folder / f"box_{number:0{digits}}")
                add(_write_lines(hl, name, *outline(placed), {}), t, "2")
        collection.save()


def _write_lines(hl: ModuleType, name: str, points: Array, ends: NDArray[np.int64], values: Values) -> str:
    """Write lines between points, and values of each; returns the file."""
    written: str = hl.unstructuredGridToVTK(
        name,
        *_columns(points),
        connectivity=ends.reshape(-1),
        offsets=np.arange(2, 2 * len(ends) + 1, 2),
        cell_types=np.full(len(ends), LINE, dtype=np.uint8),
        cellData=values,
    )
    return written


def _columns(vectors: Array) -> tuple[Array, ...]:
    return tuple(np.ascontiguousarray(column) for column in vectors.T)


def outline(placed: Boxed) -> tuple[Array, NDArray[np.int64]]:
    """Corners of a box, shape (8, 3), and its edges as pairs of them, shape (12, 2)."""
    corners = np.array(list(np.ndindex(2, 2, 2)))
    edges = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(corners[a] - corners[b]).sum() == 1]
    return placed.corner + corners @ placed.cell.T, np.array(edges)


def lines(result: ParticleResult, placed: Boxed, contacts: dict[str, NDArray[Any]]) -> tuple[Array, NDArray[np.int64]]:
    """Contacts of a frame as lines, each from a particle within the box to the partner it is in contact with.

    Parameters
    ----------
    result : ParticleResult
    placed : Boxed
        Particles of the frame, within the box.
    contacts : mapping from str to array
        Of the frame.

    Returns
    -------
    points : array, shape (N + extra, 3)
        The particles, then those ends that are an image of one, or on a wall.
    ends : array of int, shape (contacts, 2)
        Numbers of points.
    """
    count = len(placed.x)
    i, j, n = contacts["i"], contacts["j"], padded(contacts["n"])
    pair = j < count
    partner = np.append(result.radii, np.zeros(max(0, int(j.max()) + 1 - count)))[j]
    distance = result.radii[i] + partner + contacts["h"] - 2 * contacts["delta"]
    far = placed.x[i] + distance[:, None] * n
    meets = pair & (np.linalg.norm(far - placed.x[np.where(pair, j, 0)], axis=1) < 1e-6 * distance)
    extra = np.flatnonzero(~meets)
    end = np.where(meets, j, 0)
    end[extra] = count + np.arange(len(extra))
    return np.concatenate([placed.x, far[extra]]), np.column_stack([i, end])
