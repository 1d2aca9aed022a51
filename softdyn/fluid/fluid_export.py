"""Flows as files for ParaView."""

from __future__ import annotations

import importlib
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.fluid.fluid_fields import spread_to
from softdyn.fluid.mesh import Mesh
from softdyn.fluid.numbering import nodes_of
from softdyn.results.whole_files import folder_whole, written_whole
from softdyn.results.writers import require_writer

if TYPE_CHECKING:
    from softdyn.results.result import Result

Array = NDArray[np.float64]

#: VTK's number of each kind of element, and its order of our nodes: (dimension, order).
CELLS: dict[tuple[int, int], tuple[int, tuple[int, ...]]] = {
    (2, 1): (5, (0, 1, 2)),
    (3, 1): (10, (0, 1, 2, 3)),
    (2, 2): (22, (0, 1, 2, 3, 5, 4)),
    (3, 2): (24, (0, 1, 2, 3, 4, 7, 5, 6, 8, 9)),
}


def write_vtk(result: Result, path: Path) -> None:
    """Write a .pvd, which names a file for each frame, in a folder of the same name.

    Points are the nodes of the velocity, elements of its order, with ``flux`` (porosity times velocity), ``velocity``
    and ``pressure``, and of a bed ``porosity``; of grains that move ``grains_flux``, their fraction times their
    velocity. Vectors have three components.

    Parameters
    ----------
    result : FluidResult
    path : Path

    Raises
    ------
    SceneError
        If the package pyevtk is not installed, or a file cannot be written.
    """
    hl = require_writer(path)
    group = importlib.import_module("pyevtk.vtk").VtkGroup
    d = result.at.shape[1]
    order = 1 if result.u_nodes.shape[1] == d + 1 else 2
    nodes = nodes_of(Mesh(result.at, result.corners, {}), order)
    kind, permuted = CELLS[d, order]
    shape: dict[str, Any] = {
        "connectivity": np.ascontiguousarray(nodes.of[:, permuted]).reshape(-1),
        "offsets": nodes.of.shape[1] * np.arange(1, len(nodes.of) + 1),
        "cell_types": np.full(len(nodes.of), kind, dtype=np.uint8),
    }
    places = _columns(nodes.at)
    with (
        written_whole(path) as temporary,
        folder_whole(path.with_suffix("").absolute()) as (folder, final),
        ExitStack() as opened,
    ):
        collection = group(str(temporary.absolute().with_suffix("")))
        opened.callback(collection.xml.stream.close)
        digits = len(str(len(result) - 1))
        for frame in range(len(result)):
            u = spread_to(result.u[frame], result, nodes)
            values: dict[str, Any] = {"flux": _columns(u), "pressure": spread_to(result.p[frame], result, nodes)}
            if "c" in result.arrays:
                values["porosity"] = spread_to(result.c[frame], result, nodes)
                values["velocity"] = _columns(u / values["porosity"][:, None])
            else:
                values["velocity"] = _columns(u)
            if "us" in result.arrays:
                values["grains_flux"] = _columns(spread_to(result.us[frame], result, nodes))
            name = str(folder / f"flow_{frame:0{digits}}")
            file = hl.unstructuredGridToVTK(name, *places, **shape, pointData=values)
            collection.addFile(str(final / Path(file).name), float(result.t[frame]))
        collection.save()


def _columns(vectors: Array) -> tuple[Array, ...]:
    """Three components, each an array of its own."""
    full = np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
    return tuple(np.ascontiguousarray(column) for column in full.T)
