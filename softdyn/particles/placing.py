"""Where particles start: from a file, from an earlier run, or packed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.foreign_files import read_foreign, reader_of
from softdyn.particles.names import AXES, is_number
from softdyn.particles.particle_keys import PLACES
from softdyn.scene.keys import key_faults, rows
from softdyn.scene.kinds import PATH
from softdyn.tables import Column, read_columns
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.particles.chains import Chains
    from softdyn.particles.packing import Packing
    from softdyn.particles.particle_keys import ParticleScene
    from softdyn.particles.results import ParticleResult

Array = NDArray[np.float64]


def placed(
    scene: ParticleScene, file: str | Path | None, packing: Packing | None, chains: Chains | None = None
) -> dict[str, Any]:
    """Fields of a scene that follow from a file, a packing, or chains.

    Parameters
    ----------
    scene : ParticleScene
    file : str or Path, optional
        A result to start from, or a file of particles.
    packing : Packing, optional
    chains : Chains, optional

    Raises
    ------
    SceneError
        If the scene says itself what they say, or they cannot be used.
    """
    if chains is not None:
        from softdyn.particles.chains import with_chains

        if packing is not None or file is not None:
            raise SceneError(PLACES)
        return with_chains(scene, chains)
    if packing is not None and not hasattr(packing, "kind"):
        raise SceneError(f"packing must be a Packing(...), not {packing!r}")
    if file is not None and PATH.fault is not None and (fault := PATH.fault(file)):
        raise SceneError(f"[particles] file{fault}")
    if packing is not None and (file is not None or scene.positions is not None or scene.radii is not None):
        raise SceneError(PLACES)
    if scene.positions is not None:
        raise SceneError("[particles] takes positions or file, one of them")
    own = [name for name in ("radii", "species") if getattr(scene, name) is not None]
    if file is not None and own and reader_of(Path(file)) is None:
        raise SceneError("[particles] radii and species belong in the file")
    found = packed(packing) if packing is not None else read_particles(file)  # type: ignore[arg-type]
    for name in found.keys() & own:
        raise SceneError(f"[particles] {name}: {file} tells them; leave them out")
    if "radii" not in found and "radii" not in own:
        raise SceneError(f"{file} tells no sizes: give [particles] radii")
    if "box" in found and (scene.box is not None or scene.tilt):
        source = "[packing]" if packing is not None else "[particles] file"
        raise SceneError(f"[box] follows from {source}: leave it out, but for its depth")
    given = {name for name in ("depth", "films") if getattr(scene, name) is not None}
    return {name: value for name, value in found.items() if name not in given}


def packed(packing: Packing) -> dict[str, Any]:
    """Positions, radii and box of a packing, as fields of a :class:`ParticleScene`.

    Raises
    ------
    SceneError
    """
    from softdyn.particles.packing import lattice_packing, random_packing

    faults = key_faults(packing)
    if faults:
        raise SceneError(listed(faults))
    random = packing.kind == "random"
    wanted = ("count", "dimension", "fraction", "seed", "radii") if random else ("cells", "spacing", "radii")
    given = [row.field for row in rows(type(packing)) if getattr(packing, row.field) is not None]
    missing = [name for name in wanted if name not in given]
    other = [name for name in given if name not in (*wanted, "kind")]
    if missing or other:
        raise SceneError(
            f"[packing] of kind {packing.kind!r} takes {', '.join(wanted)}"
            + (f"; {', '.join(missing)} missing" if missing else "")
            + (f"; {', '.join(other)} unknown" if other else "")
        )
    chosen: dict[str, Any] = {name: getattr(packing, name) for name in wanted}
    radii = packing.radii if isinstance(packing.radii, (list, tuple, np.ndarray)) else [packing.radii]
    drawn = random and isinstance(packing.radii, Mapping)
    if not drawn and (not len(radii) or not all(map(is_number, radii))):
        raise SceneError(f"[packing] radii must be a number, or a list of some, not {radii!r}")
    if random:
        x, size, lengths = random_packing(**chosen | {"radii": packing.radii if drawn else radii})
    else:
        x, lengths = lattice_packing(packing.kind, chosen["cells"], chosen["spacing"])
        size = np.array(radii, dtype=float)[np.arange(len(x)) % len(radii)]
    return {"positions": x, "radii": size, "box": list(lengths)}


def read_particles(path: str | Path) -> dict[str, Any]:
    r"""Positions, radii, species and box from a file, as arguments of a :class:`ParticleScene`.

    Parameters
    ----------
    path : str or Path
        Of a result (.npz), whose last frame is taken with its films; of a table with the headings x, y, z, radius
        and species in any order (y, z and species optional; ``diameter`` in the place of radius is twice that), see
        :mod:`softdyn.tables`; or of another program: LAMMPS data (.data, .lmp) and dumps (.dump, .lammpstrj), XYZ and
        extended XYZ (.xyz, .extxyz), GSD (.gsd), points of VTK (.vtk, .vtu), see
        :mod:`softdyn.particles.foreign_files`.

    Returns
    -------
    dict
        ``positions`` (N, d), ``radii`` (N,) but for files of other programs that tell no sizes; ``species``, ``box``,
        ``tilt``, ``depth`` and ``films`` if there are any.

    Raises
    ------
    SceneError
        Naming the line at fault.

    Examples
    --------
    >>> from pathlib import Path
    >>> text = '2\nLattice="9 0 0 0 9 0 0 0 9" Properties=species:S:1:pos:R:3:radius:R:1\nA 1 1 1 1.0\nA 4 1 1 1.2\n'
    >>> _ = Path("two.xyz").write_text(text, encoding="utf-8")
    >>> read_particles("two.xyz")["radii"]
    array([1. , 1.2])
    """
    path = Path(path)
    read = reader_of(path)
    if read is not None:
        return read_foreign(path, read)
    if path.suffix != ".npz":
        return _from_table(path)
    from softdyn.particles.results import load_particles

    try:
        return from_result(load_particles(path))
    except SceneError as error:
        raise SceneError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def from_result(result: ParticleResult) -> dict[str, Any]:
    """Positions, radii, species, box and films at the end of a run, as arguments of the next :class:`ParticleScene`.

    Nothing is wrapped: coordinates, images and the tilt of the box go on from where they were, so that displacements
    and the strain of runs in sequence are those of one run. Time starts anew.

    Returns
    -------
    dict
        ``positions`` (N, d), ``radii`` (N,), ``films``; ``species``, ``box`` and ``tilt`` if there are any.

    Raises
    ------
    SceneError
        If the result holds no frame.

    Examples
    --------
    >>> physics = dict(law="rognon_gay", parameters={"E": 1.0, "eta": 1.0}, drag=1.0, until_t=10.0)
    >>> result = simulate(ParticleScene(positions=[[0, 0], [2.1, 0]], radii=1.0, **physics))  # doctest: +SKIP
    >>> result = simulate(ParticleScene(**from_result(result), **physics))                    # doctest: +SKIP
    """
    if not len(result):
        raise SceneError("the result holds no frame to start from")
    x, cell = result.x[-1].copy(), result.cell[-1]
    edges = np.diag(cell)
    periodic = edges > 0
    placed: dict[str, Any] = {"positions": x, "radii": result.radii}
    names = result.species_names.tolist()
    if names != [""]:
        placed["species"] = [names[k] for k in result.species]
    if periodic.any():
        if periodic.all() and len(cell) < 3:
            placed["depth"] = float(result.depth)
        placed["box"] = [float(edge) if repeats else None for edge, repeats in zip(edges, periodic, strict=True)]
        if len(cell) > 1 and periodic[0]:
            placed["tilt"] = float(cell[0, 1])
    placed["films"] = _films(result, x, cell)
    return placed


def _films(result: ParticleResult, x: Array, cell: Array) -> dict[str, Any]:
    """Films of the last frame, between particles that are now at x, in the box with these lattice vectors."""
    contacts = result.contacts(-1)
    films: dict[str, Any] = {name: contacts[name] for name in ("i", "j", "h", "T") if name in contacts}
    i, j = contacts["i"], contacts["j"]
    pair = np.flatnonzero(j < len(x))
    i, j = i[pair], j[pair]
    r = result.radii[i] + result.radii[j] + contacts["h"][pair] - 2 * contacts["delta"][pair]
    across = contacts["n"][pair] * r[:, None] - (x[j] - x[i])
    loose = np.diag(np.diag(cell) == 0)
    films["shift"] = np.zeros((len(contacts["i"]), x.shape[1]), dtype=np.int64)
    films["shift"][pair] = np.rint(np.linalg.solve(cell + loose, across.T).T) * ~np.diag(loose)
    if len(result.wall_normal):
        films |= {"wall_point": result.wall_point[-1], "wall_normal": result.wall_normal}
    return films


#: Columns of a table of particles.
COLUMNS = (
    Column("x", ("X",)),
    *(Column(axis, (axis.upper(),), needed=False) for axis in "yz"),
    Column("radius", ("r", "R"), needed=False),
    Column("diameter", needed=False),
    Column("species", ("type",), needed=False, words=True),
)


def _from_table(path: Path) -> dict[str, Any]:
    read = read_columns(path, "table of particles", COLUMNS)
    axes = [name for name in AXES if name in read]
    if "z" in axes and "y" not in axes:
        raise SceneError(f"table of particles {path}: there is a column z, and none y")
    if ("radius" in read) == ("diameter" in read):
        raise SceneError(f"table of particles {path}: a column radius or diameter is needed, one of them")
    radii = read["radius"] if "radius" in read else read["diameter"] / 2
    if not len(read):
        raise SceneError(f"table of particles {path}: there are headings, and no particle")
    nameless = np.flatnonzero(read["species"] == "") if "species" in read else np.empty(0, np.int64)
    if len(nameless):
        raise SceneError(f"{read.at(int(nameless[0]))}: the species is empty")
    placed: dict[str, Any] = {"positions": np.column_stack([read[axis] for axis in axes]), "radii": radii}
    return {**placed, "species": read["species"].tolist()} if "species" in read else placed
