"""What a run of a fluid gives."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.fluid.fields import AXES
from softdyn.results.origin import Origin, about, origin_in, origin_now
from softdyn.results.result import TABLES, Result, dataset, table, write_table
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from softdyn.fluid.balances import Measures
    from softdyn.fluid.flow_system import FluidSystem

Array = NDArray[np.float64]

#: What every step tells first.
HISTORY = ("step_t", "step_dt", "step_newton", "step_residual", "step_error")


@dataclass(frozen=True)
class FlowFrame:
    """A state at an output time.

    Attributes
    ----------
    t : float
    u : array, shape (nodes, d)
        Flux of the fluid, porosity times velocity, at the nodes of the velocity.
    p : array, shape (nodes,)
        At the nodes of the pressure.
    c : array, shape (nodes,)
        Porosity, at the nodes of the velocity; empty without a bed.
    us : array, shape (nodes, d)
        Flux of the grains; empty where they are at rest.
    """

    t: float
    u: Array
    p: Array
    c: Array
    us: Array


def frame_of(system: FluidSystem, t: float, x: Array) -> FlowFrame:
    """Frame of a solution: where the pressure has no level, its mean over the nodes is 0.

    Parameters
    ----------
    system : FluidSystem
    t : float
    x : array, shape (unknowns,)
        Velocities, then pressures.
    """
    from softdyn.fluid.flow_system import without_level

    known, p = system.coefficients(t), without_level(system, x)[system.velocities :]
    u = x[: system.velocities].reshape(system.dimension, -1).T.copy()
    return FlowFrame(t, u, p, known.get("c", np.empty(0)), known.get("us", np.empty((0, system.dimension))))


@dataclass(frozen=True, repr=False)
class FluidResult(Result):
    """A run of a fluid; all numbers in the units of the scene.

    Attributes
    ----------
    law, target : str
        The law is the name of the equations.
    parameters : mapping from str to float
    arrays : mapping from str to array
        ``t`` (frames,); ``u`` (frames, nodes of the velocity, d): flux of the fluid, porosity times velocity; ``p``
        (frames, nodes of the pressure); with a bed ``c`` (frames, nodes of the velocity), the porosity, with moving
        grains ``us`` (frames, nodes of the velocity, d), their flux;

        ``at`` (points, d), ``corners`` (elements, d + 1): the mesh; ``u_at``, ``p_at``: places of the nodes;
        ``u_nodes``, ``p_nodes`` (elements, nodes of an element): corners, then, of order 2, the middles of edges;
        ``boundary_names``, and for each of these ``boundary_NAME`` (facets, d), points of its facets;

        for each step ``step_t``, ``step_dt``, ``step_newton`` (iterations), ``step_residual`` (relative),
        ``step_error`` (over what is allowed; nan where nothing tells); for each boundary that is not periodic
        ``force_NAME`` (steps, d), of the fluid on it, and ``flux_NAME`` (steps,), out of the domain;
        ``momentum_rate``, ``volume_force``, ``bed_force`` (steps, d), of the fluid on the grains; ``power_boundaries``,
        ``power_force``, ``kinetic_rate``, ``dissipation``, ``power_rest``, ``kinetic_energy``; ``mass_imbalance``,
        ``momentum_imbalance``, ``energy_imbalance`` (steps,), relative. ``step_names`` tells the names of those that
        are measured of each step. Each is an attribute, too.
    stats : mapping
        How the run went; ``warnings``: list of str.
    origin : Origin, optional
        By what it was made.
    """

    kind: ClassVar[str] = "fluid"
    law: str
    target: str
    parameters: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    stats: Mapping[str, Any]
    origin: Origin | None = None

    def __repr__(self) -> str:
        return f"<FluidResult, {self.stats['elements']}: {len(self)} frames up to t={float(self.t[-1]):.6g}>"

    @property
    def order(self) -> int:
        """Of the velocity."""
        return 1 if self.arrays["u_nodes"].shape[1] == self.arrays["corners"].shape[1] else 2

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the run warns of."""
        return tuple(self.stats["warnings"])

    def plot(
        self, *, width: str | float | None = None, panels: Sequence[str] | None = None, ax: Axes | None = None
    ) -> Figure:
        """Draw the flow at the end, and the forces over time.

        Parameters
        ----------
        width : "column", "page" or float, optional
            Of the figure; the latter in inches.
        panels : sequence of str, optional
            Some of "speed", "pressure", "porosity", "velocities", "bond_lengths", "force_x" and so on.
        ax : Axes, optional
            Takes a single one: see :func:`softdyn.fluid.fluid_plots.plot_fluid`.
        """
        if not len(self):
            raise SceneError("the result holds no frame to draw")
        from softdyn.fluid.fluid_plots import plot_fluid

        return plot_fluid(self, width=width, panels=panels, ax=ax)

    def animate(self, path: str | Path) -> Path:
        """Draw the frames as an animation: .gif, or .mp4 with the program ffmpeg."""
        from softdyn.fluid.fluid_plots import animate_fluid

        return animate_fluid(self, Path(path))

    def save(self, path: str | Path) -> Path:
        """Write to .npz, all of it; or to .pvd for ParaView, .csv or .nc, which are not read back.

        A .csv has what is one number a step, a .nc (netCDF) everything; both need ``pip install 'softdyn[data]'``.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written.
        """
        path = Path(path)
        if path.suffix in TABLES:
            write_table(self, path)
            return path
        if path.suffix != ".npz":
            from softdyn.fluid.fluid_export import write_vtk

            write_vtk(self, path)
            return path
        beside: dict[str, NDArray[Any]] = {}
        rest = {
            "kind": self.kind,
            **about(self.origin, beside),
            "law": self.law,
            "target": self.target,
            "parameters": dict(self.parameters),
            "stats": dict(self.stats),
        }
        content: dict[str, Any] = {"about": np.array(json.dumps(rest)), **self.arrays, **beside}
        with written_whole(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **content)
        return path

    def to_xarray(self) -> Dataset:
        """Everything as an xarray.Dataset; needs ``pip install 'softdyn[data]'``."""
        names = {name: _dimensions(name, array) for name, array in self.arrays.items()}
        return dataset(self, names)

    def to_pandas(self) -> DataFrame:
        """What is one number a step, as a pandas.DataFrame over time; needs ``pip install 'softdyn[data]'``."""
        steps = self.arrays["step_t"].shape
        return table({"t": self.step_t, **{k: v for k, v in self.arrays.items() if v.shape == steps and k != "t"}})


def _dimensions(name: str, array: NDArray[Any]) -> tuple[str, ...]:
    if name == "t":
        return ("frame",)
    return tuple(f"{name}_{k}" for k in range(array.ndim))


def gather_flow(
    system: FluidSystem,
    measures: Measures,
    frames: Iterable[FlowFrame],
    history: Sequence[Sequence[float]],
    stats: Mapping[str, Any],
) -> FluidResult:
    """Put a result together from its frames and steps.

    Parameters
    ----------
    system : FluidSystem
    measures : Measures
        What is measured of the flow.
    frames : iterable of FlowFrame
    history : sequence of rows of float
        What is noted of each step.
    stats : mapping
        What is told of the run.
    """
    frames, d = list(frames), system.dimension
    mesh, count = system.mesh, system.velocity.count
    arrays: dict[str, NDArray[Any]] = {
        "t": np.array([frame.t for frame in frames]),
        "u": np.array([frame.u for frame in frames]).reshape(-1, count, d),
        "p": np.array([frame.p for frame in frames]).reshape(-1, system.pressure.count),
        "at": mesh.at,
        "corners": np.asarray(mesh.corners, dtype=np.int64),
        "u_at": system.velocity.at,
        "p_at": system.pressure.at,
        "u_nodes": np.asarray(system.velocity.of, dtype=np.int64),
        "p_nodes": np.asarray(system.pressure.of, dtype=np.int64),
        "boundary_names": np.array(list(mesh.boundaries)),
        **{f"boundary_{name}": np.asarray(facets, dtype=np.int64) for name, facets in mesh.boundaries.items()},
    }
    if system.porosity is not None:
        arrays["c"] = np.array([frame.c for frame in frames]).reshape(-1, count)
    if system.grains is not None:
        arrays["us"] = np.array([frame.us for frame in frames]).reshape(-1, count, d)
    names = (*HISTORY, *measures.columns)
    told = told_of_steps(np.array(history, dtype=float).reshape(-1, len(names)), names, AXES[:d])
    arrays |= told
    arrays["step_names"] = np.array([name for name in told if name not in HISTORY])
    return FluidResult(
        law=system.kernel.form,
        target=system.kernel.target,
        parameters=dict(system.numbers),
        arrays=arrays,
        stats=stats,
        origin=origin_now(system.scene, system.kernel.key),
    )


def told_of_steps(rows: Array, names: Sequence[str], axes: Sequence[str]) -> dict[str, Array]:
    """Arrays of what is told of each step: numbers, and vectors and tensors of those of their components.

    Parameters
    ----------
    rows : array, shape (steps, columns)
    names : sequence of str
        Of the columns: a component is told by its axes, as in force_top_x, stress_xy.
    axes : sequence of str
    """
    found = {name: rows[:, k] for k, name in enumerate(names)}
    for letters in (list(axes), [a + b for a in axes for b in axes]):
        for stem in [name.removesuffix(f"_{letters[0]}") for name in found if name.endswith(f"_{letters[0]}")]:
            parts = [f"{stem}_{letter}" for letter in letters]
            if all(part in found for part in parts):
                whole = np.stack([found.pop(part) for part in parts], axis=1)
                found[stem] = whole if len(letters) == len(axes) else whole.reshape(-1, len(axes), len(axes))
    return found


def fluid_from(content: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> FluidResult:
    """Result from the content of a file.

    Raises
    ------
    ValueError, KeyError
        If an array is missing, or does not fit the others.
    """
    origin = origin_in(content, arrays)
    arrays = {name: array for name, array in arrays.items() if not name.startswith("scene_")}
    sizes: dict[str, int] = {}
    known = {"t": "f", "u": "fnd", "p": "fm", "at": "Pd", "u_at": "nd", "p_at": "md"}
    known |= {"corners": "ek", "u_nodes": "el", "p_nodes": "ek", "boundary_names": "b"}
    known |= {name: letters for name, letters in {"c": "fn", "us": "fnd"}.items() if name in arrays}
    known |= dict.fromkeys(HISTORY, "s") | ({"step_names": "q"} if "step_names" in arrays else {})
    for name, letters in known.items():
        array = arrays[name]
        if array.dtype.kind not in ("U" if name in ("boundary_names", "step_names") else "fiu") or array.ndim != len(
            letters
        ):
            raise ValueError(f"{name} is not an array of {len(letters)} dimensions")
        for letter, size in zip(letters, array.shape, strict=True):
            if sizes.setdefault(letter, size) != size:
                raise ValueError(f"{name} has the shape {array.shape}, which does not fit the other arrays")
    for name in arrays.get("step_names", ()):
        if name not in arrays or arrays[name].dtype.kind != "f" or len(arrays[name]) != sizes["s"]:
            raise ValueError(f"{name} does not hold numbers for each step")
    boundaries = [f"boundary_{name}" for name in arrays["boundary_names"]]
    for name, letter in {"corners": "P", "u_nodes": "n", "p_nodes": "m", **dict.fromkeys(boundaries, "P")}.items():
        array = arrays[name]
        if array.dtype.kind not in "iu" or ((array < 0) | (array >= sizes[letter])).any():
            raise ValueError(f"{name} does not hold whole numbers from 0 to {sizes[letter] - 1}")
    for name in ("t", "u", "p", "at"):
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} is not finite everywhere")
    parameters, stats = dict(content["parameters"]), dict(content["stats"])
    if not isinstance(stats.get("warnings"), list) or not isinstance(stats.get("elements"), str):
        raise ValueError("it does not tell how the run went")
    return FluidResult(str(content["law"]), str(content["target"]), parameters, arrays, stats, origin)
