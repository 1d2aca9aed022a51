"""What a run of many particles gives."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.geometry import Contacts, bare_contacts, directions, flow, lattice, rotations
from softdyn.particles.portions import in_portions, portion
from softdyn.particles.system import GIVEN, TAKEN, PreparedScene, System, contact_state, opening_rates
from softdyn.results.origin import Origin, about, origin_in, origin_now
from softdyn.results.registry import load_result
from softdyn.results.result import TABLES, Result, dataset, table, write_table
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

Array = NDArray[np.float64]

HISTORY = ("step_t", "step_dt", "step_residual", "step_error", "step_contacts")


@dataclass(frozen=True)
class Frame:
    """A state at an output time; contacts are those within their range.

    Attributes
    ----------
    t : float
    x, v : array, shape (N, d)
    i, j : array of int, shape (contacts,)
    shift : array of int, shape (contacts, d)
        The lattice vector by which particle j is displaced. Directions and deflections follow from it, and wait until
        the result is put together: frames are many, and kept in memory.
    h, F : array, shape (contacts,)
    stress : array, shape (d, d)
        > 0 in tension; of the force along the first axis on a plane normal to the second. In a periodic box that of the
        contacts and, with inertia, of the momentum that fluctuating velocities carry, force/length^2; otherwise the
        virial of contacts and drag, force times length. By all methods.
    cell : array, shape (d, d)
        Lattice vectors of the periodic box, as columns; 0 along axes that are not periodic.
    walls : array, shape (walls, d)
        A point of each wall.
    gradient : array, shape (d, d)
        Velocity gradient of the background flow.
    energy : array
        Exchanged since the start: kinds as ``System.works``; and what is stored elastically.
    T : array, shape (contacts, d)
        Tangential forces, from i to j; of no columns without tangential motion.
    spin : array, shape (N, rotations)
        Angular velocities; of no columns without tangential motion.
    """

    t: float
    x: Array
    v: Array
    i: NDArray[np.int64]
    j: NDArray[np.int64]
    shift: NDArray[np.int64]
    h: Array
    F: Array
    stress: Array
    cell: Array
    walls: Array
    gradient: Array
    energy: Array
    T: Array
    spin: Array


def frame_of(system: System, t: float, x: Array, v: Array, contacts: Contacts, energy: Array) -> Frame:
    """Frame of a state; v is as in :class:`softdyn.particles.state.State`.

    Parameters
    ----------
    system : System
    t : float
    x : array, shape (N, d)
    v : array, shape (N, w)
    contacts : Contacts
    energy : array
        Exchanged since the start, by the kinds of ``system.works``; and what is stored elastically.
    """
    whole = v
    v, spin = v[:, : x.shape[1]], v[:, x.shape[1] :] / system.radii[:, None]
    cell = lattice(system.box, t)

    def pull(part: slice) -> tuple[Array, Array]:
        some = portion(contacts, part)
        n, r = directions(some, x, cell, system.walls)
        rate = None if system.kernel.contact == "film" else opening_rates(system, some, t, whole, n)
        F = contact_state(system, some, some.S - r, some.h, rate)["F"]
        along = F
        for mechanism in system.having["central"]:
            more = mechanism.central(system, some, t, r)
            along = along if more is None else along + more[0]
        virial = np.einsum("c,ca,cb->ab", along * r, n, n)
        if some.T.size:
            virial += np.einsum("c,ca,cb->ab", r, some.T, n)
        return F, virial

    F, virials = zip(*in_portions(pull, len(contacts)), strict=True)
    stress = -sum(virials)
    if system.dragged and not system.box.periodic.any():
        resisting = system.resistance[:, :1] * (v - flow(system.box, x))
        stress -= np.einsum("ia,ib->ab", resisting, x - x.mean(axis=0))
    if system.box.periodic.all():
        for mechanism in system.having["flux"]:
            stress -= mechanism.flux(system, x, v)
        stress = stress / system.box.volume
    near = contacts.h < system.reach
    return Frame(
        t,
        x.copy(),
        v.copy(),
        contacts.i[near],
        contacts.j[near],
        contacts.shift[near],
        contacts.h[near],
        np.concatenate(F)[near],
        stress,
        cell,
        np.array([wall.point for wall in system.walls]).reshape(len(system.walls), x.shape[1]),
        system.box.gradient,
        energy,
        contacts.T[near],
        spin,
    )


def _geometry(frame: Frame, system: PreparedScene) -> tuple[Array, Array]:
    """Direction of each contact of a frame, and the deflection of its surfaces."""
    contacts = bare_contacts(frame.i, frame.j, frame.shift, system.radii)
    walls = tuple(replace(wall, point=point) for wall, point in zip(system.walls, frame.walls, strict=True))
    n, r = directions(contacts, frame.x, frame.cell, walls)
    return n, (contacts.S - r + frame.h) / 2


@dataclass(frozen=True, repr=False)
class ParticleResult(Result):
    """A run of many particles; all numbers in the units of the scene's parameters.

    Attributes
    ----------
    law, target : str
    parameters : mapping
    arrays : mapping from str to array
        ``t`` (frames,), ``x`` and ``v`` (frames, N, d): positions, never wrapped, and velocities; ``stress`` (frames,
        d, d); ``radii`` (N,), ``species`` (N,) and ``species_names``;

        ``box`` (d,): lengths of the periodic box at the start, inf along axes that are not periodic; ``cell`` (frames,
        d, d): its lattice vectors as columns, 0 along such axes; ``depth`` (), in fewer than three dimensions: that of
        the layer (d = 2), or width and depth of the column (d = 1), in whose volume the stress is; ``gradient``
        (frames, d, d) of the background flow's
        velocity, with which it moves; ``wall_point`` (frames, walls, d), ``wall_normal``
        (walls, d), from the particles into the wall, ``wall_rigid`` (walls,);

        ``energy_external``, ``energy_flow``, ... (frames,): each of the terms of ``energy`` up to that frame;

        contacts within their range, those of frame k at ``contact_start[k]:contact_start[k + 1]``: ``contact_i``,
        ``contact_j`` (walls from N on), ``contact_h``, ``contact_delta`` (deflection of each surface),
        ``contact_F``, ``contact_n`` (direction from i to j);

        with tangential motion ``contact_T`` (tangential force, from i to j), and ``spin`` (frames, N, rotations), the
        angular velocities;

        for each step, ``step_t``, ``step_dt``, ``step_residual`` (of the balance of forces, and of an imposed stress,
        relative to the largest),
        ``step_error`` (in units of what is allowed), ``step_contacts`` (how many within their range).
        Each is an attribute, too.
    energy : mapping from str to float
        Put in by ``external`` forces, the ``flow`` and the moving ``box``; ``stored`` elastically; taken by ``gaps``,
        ``drag``, ``remote`` forces and the dependence of F_ela on h (``U_h``), with tangential motion also by
        ``sliding``, ``rolling`` and a change of the tangential stiffness (``k_t``); under gravity, put in by
        ``gravity``; ``imbalance``, what is left over relative to the sum of all sizes.
    stats : mapping
        How the run went; ``warnings``: list of str.
    origin : Origin, optional
        By what it was made; None of results that earlier versions have saved.
    """

    kind: ClassVar[str] = "particles"
    law: str
    target: str
    parameters: Mapping[str, Any]
    arrays: Mapping[str, NDArray[Any]]
    energy: Mapping[str, float]
    stats: Mapping[str, Any]
    origin: Origin | None = None

    def __repr__(self) -> str:
        count, frames = len(self.radii), len(self)
        return f"<ParticleResult of {self.law}: {count} particles, {frames} frames up to t={float(self.t[-1]):.6g}>"

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the run warns of."""
        return tuple(self.stats["warnings"])

    def contacts(self, frame: int) -> dict[str, NDArray[Any]]:
        """Contacts of one frame: i, j, h, delta, F, n, and T with tangential motion."""
        frame = range(len(self))[frame]
        start, end = self.arrays["contact_start"][frame : frame + 2]
        names = [name for name in ("i", "j", "h", "delta", "F", "n", "T") if f"contact_{name}" in self.arrays]
        return {name: self.arrays[f"contact_{name}"][start:end] for name in names}

    def plot(
        self, *, width: str | float | None = None, panels: Sequence[str] | None = None, ax: Axes | None = None
    ) -> Figure:
        """Draw the contact network at the end, and what is measured on the run.

        Parameters
        ----------
        width : "column", "page" or float, optional
            Of the figure; the latter in inches.
        panels : sequence of str, optional
            Some of "network", "energy", "stress" and so on.
        ax : Axes, optional
            Takes a single one: see :func:`softdyn.particles.particle_plots.plot_particles`.

        Raises
        ------
        SceneError
            If there is no frame, as after a run that failed before the first.
        """
        if not len(self):
            raise SceneError("the result holds no frame to draw")
        from softdyn.particles.particle_plots import plot_particles

        return plot_particles(self, width=width, panels=panels, ax=ax)

    def animate(self, path: str | Path) -> Path:
        """Draw the frames of a run in one or two dimensions as an animation: .gif, or .mp4 with the program ffmpeg.

        Raises
        ------
        SceneError
            If it cannot be drawn.
        """
        from softdyn.particles.particle_plots import animate

        return animate(self, Path(path))

    def save(self, path: str | Path) -> Path:
        """Write to .npz, all of it (see :func:`load_particles`); or to .gsd for OVITO, .pvd for ParaView, .csv or .nc.

        Those for OVITO and ParaView need ``pip install 'softdyn[formats]'``: see :mod:`softdyn.particles.export`. A
        .csv has what is one number a frame, stress and strain among it, a .nc (netCDF) everything; both need
        ``pip install 'softdyn[data]'``. None of these is read back.

        Raises
        ------
        SceneError
            If the ending is another, a package is missing, or the file cannot be written; then nothing is left behind
            but for frames of a .pvd.
        """
        path = Path(path)
        if path.suffix in TABLES:
            write_table(self, path)
            return path
        if path.suffix != ".npz":
            from softdyn.particles import export

            export.write(self, path)
            return path
        beside: dict[str, NDArray[Any]] = {}
        rest = {
            "kind": self.kind,
            **about(self.origin, beside),
            "law": self.law,
            "target": self.target,
            "parameters": dict(self.parameters),
            "energy": dict(self.energy),
            "stats": dict(self.stats),
        }
        content: dict[str, Any] = {"about": np.array(json.dumps(rest)), **self.arrays, **beside}
        with written_whole(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **content)
        return path

    def to_xarray(self) -> Dataset:
        """Everything as an xarray.Dataset; needs ``pip install 'softdyn[data]'``.

        Contacts of all frames stand behind one another, those of frame k at ``contact_start[k]:contact_start[k + 1]``.
        """
        known = {**SHAPES, **TANGENTIAL_SHAPES}
        known |= {name: "f" for name in self.arrays if name.startswith("energy_")}
        names = {
            name: tuple(DIMENSIONS[letter] for letter in known[name])
            if name in known
            else tuple(f"{name}_{k}" for k in range(array.ndim))
            for name, array in self.arrays.items()
        }
        # a tensor has two axes
        twice = {
            name: (*those[:-1], "other_axis") if those[-2:] == ("axis",) * 2 else those for name, those in names.items()
        }
        return dataset(self, twice)

    def to_pandas(self) -> DataFrame:
        """Stress, energies and what else is one number a frame, as a pandas.DataFrame over time.

        Needs ``pip install 'softdyn[data]'``.
        """
        columns = {name: array for name, array in self.arrays.items() if array.shape == self.t.shape}
        axes = range(self.stress.shape[-1])
        stress = {f"stress_{'xyz'[a]}{'xyz'[b]}": self.stress[:, a, b] for a in axes for b in axes}
        from softdyn.particles.observables import strain

        strained = {"strain": strain(self)} if len(axes) > 1 else {}
        rest = {name: values for name, values in columns.items() if SHAPES.get(name, "f") == "f"}
        return table({"t": self.t, **strained, **stress, **rest})


def gather(
    system: PreparedScene,
    frames: list[Frame],
    history: list[tuple[float, float, float, float, int]],
    energy: Mapping[str, float],
    stats: Mapping[str, Any],
) -> ParticleResult:
    """Put a result together from its frames.

    Parameters
    ----------
    system : PreparedScene
    frames : list of Frame
    history : list of rows
        What is noted of each step.
    energy : mapping from str to float
        What became of it in the run, by kinds.
    stats : mapping
        What is told of the run.
    """
    count, d = system.x.shape
    arrays: dict[str, NDArray[Any]] = {
        "t": np.array([frame.t for frame in frames]),
        "x": np.array([frame.x for frame in frames]).reshape(-1, count, d),
        "v": np.array([frame.v for frame in frames]).reshape(-1, count, d),
        "stress": np.array([frame.stress for frame in frames]).reshape(-1, d, d),
        "radii": system.radii,
        "species": system.species,
        "box": system.box.lengths,
        "species_names": np.array(system.names),
        "cell": np.array([frame.cell for frame in frames]).reshape(-1, d, d),
        "gradient": np.array([frame.gradient for frame in frames]).reshape(-1, d, d),
        "wall_point": np.array([frame.walls for frame in frames]).reshape(len(frames), len(system.walls), d),
        "wall_normal": np.array([wall.normal for wall in system.walls]).reshape(len(system.walls), d),
        "wall_rigid": np.array([wall.rigid for wall in system.walls], dtype=bool),
        "contact_start": np.cumsum([0, *(len(frame.i) for frame in frames)]),
    }
    if d < 3:
        arrays["depth"] = np.array(system.box.depth)
    if system.width > d:
        arrays["spin"] = np.array([frame.spin for frame in frames]).reshape(-1, count, rotations(d))
        arrays["contact_T"] = np.concatenate([np.empty((0, d)), *(frame.T for frame in frames)])
    for name in ("i", "j", "h", "F"):
        empty = np.empty(0, dtype=np.int64 if name in "ij" else float)
        arrays[f"contact_{name}"] = np.concatenate([empty, *(getattr(frame, name) for frame in frames)])
    start = arrays["contact_start"]
    arrays["contact_n"], arrays["contact_delta"] = np.empty((start[-1], d)), np.empty(start[-1])
    for frame, *ends in zip(frames, start[:-1], start[1:], strict=True):
        arrays["contact_n"][slice(*ends)], arrays["contact_delta"][slice(*ends)] = _geometry(frame, system)
    for mechanism in system.having["columns"]:
        arrays |= mechanism.columns(system, frames)
    energies = (*system.works, "stored")
    arrays |= {f"energy_{name}": np.array([frame.energy[k] for frame in frames]) for k, name in enumerate(energies)}
    columns = np.array(history, dtype=float).reshape(-1, len(HISTORY))
    arrays |= {name: columns[:, k] for k, name in enumerate(HISTORY)}
    return ParticleResult(
        law=system.law,
        target=system.target,
        parameters={k: dict(v) if isinstance(v, Mapping) else float(v) for k, v in system.scene.parameters.items()},
        arrays=arrays,
        energy={name: float(value) for name, value in energy.items()},
        stats=stats,
        origin=origin_now(system.scene, system.fingerprint),
    )


#: Shapes of what every result holds, a letter for each size: f frames, N particles, w walls, c contacts, n steps.
SHAPES = {
    "t": "f", "x": "fNd", "v": "fNd", "stress": "fdd", "radii": "N", "species": "N", "box": "d",
    "cell": "fdd", "gradient": "fdd", "wall_point": "fwd", "wall_normal": "wd", "wall_rigid": "w",
    "contact_i": "c", "contact_j": "c", "contact_h": "c", "contact_delta": "c", "contact_F": "c", "contact_n": "cd",
    **dict.fromkeys(HISTORY, "n"), **{f"energy_{name}": "f" for name in (*GIVEN, *TAKEN, "stored")},
}  # fmt: skip
#: What the letters stand for.
DIMENSIONS = {
    "f": "frame", "N": "particle", "d": "axis", "w": "wall", "c": "contact", "n": "step", "m": "rotation",
}  # fmt: skip
#: Shapes of what tangential motion adds; m rotations.
TANGENTIAL_SHAPES = {"spin": "fNm", "contact_T": "cd"}


def result_from(content: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> ParticleResult:
    """Result from the content of a file.

    Raises
    ------
    ValueError, KeyError
        If an array is missing, or does not fit the others.
    """
    origin = origin_in(content, arrays)
    arrays = {name: array for name, array in arrays.items() if not name.startswith("scene_")}
    sizes: dict[str, int] = {}
    if arrays["box"].size < 3 and "depth" not in arrays:
        arrays = {**arrays, "depth": np.array(1.0)}  # of earlier versions, whose layers were one unit of length deep
    more = {"depth": ""} if "depth" in arrays else {}
    more |= {name: "f" for name in arrays if name.startswith("energy_")}
    more |= TANGENTIAL_SHAPES if "contact_T" in arrays else {}
    for name, shape in {**SHAPES, **more}.items():
        array = arrays[name]
        if array.dtype.kind not in "fiub" or array.ndim != len(shape):
            raise ValueError(f"{name} is not an array of {len(shape)} dimensions of numbers")
        for letter, size in zip(shape, array.shape, strict=True):
            if sizes.setdefault(letter, size) != size:
                raise ValueError(f"{name} has the shape {array.shape}, which does not fit the other arrays")
    names, start = arrays["species_names"], arrays["contact_start"]
    if names.ndim != 1 or names.dtype.kind != "U":
        raise ValueError("species_names is not a list of words")
    most = {
        "species": len(names),
        "contact_i": sizes["N"],
        "contact_j": sizes["N"] + sizes["w"],
        "contact_start": sizes["c"] + 1,
    }
    for name, size in most.items():
        if arrays[name].dtype.kind not in "iu" or ((arrays[name] < 0) | (arrays[name] >= size)).any():
            raise ValueError(f"{name} does not hold whole numbers from 0 to {size - 1}")
    if start.shape != (sizes["f"] + 1,) or start[0] != 0 or start[-1] != sizes["c"] or (np.diff(start) < 0).any():
        raise ValueError("contact_start does not fit the contacts")
    for name in ("t", "x", "radii", "cell", "wall_point", "wall_normal", "contact_h"):
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} is not finite everywhere")
    if not (arrays["radii"] > 0).all() or not (arrays["contact_h"] >= 0).all():
        raise ValueError("not all radii are positive, or a gap is negative")
    law, target = str(content["law"]), str(content["target"])
    parameters, energy, stats = (dict(content[name]) for name in ("parameters", "energy", "stats"))
    return ParticleResult(law, target, parameters, arrays, energy, stats, origin)


def load_particles(path: str | Path) -> ParticleResult:
    """Read a result saved as .npz.

    Raises
    ------
    SceneError
        If the file is not such a result.

    Examples
    --------
    With ``result`` of the example of :func:`softdyn.particles.simulate`:

    >>> from softdyn.particles import load
    >>> path = result.save("sheared.npz")
    >>> (load(path).x[-1] == result.x[-1]).all()
    np.True_
    """
    result = load_result(path)
    if not isinstance(result, ParticleResult):
        raise SceneError(f"{path} holds a run of two particles")
    return result
