"""Scene files of many particles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.geometry import Wall
from softdyn.particles.packing import lattice_packing, random_packing
from softdyn.particles.particle_scene import Hold, ParticleScene, Push
from softdyn.particles.results import ParticleResult, load_particles
from softdyn.particles.words import AXES
from softdyn.scene.reading import is_particle_scene, read_toml, unknown_keys
from softdyn.scene.time_tables import read_table
from softdyn.tables import Column, read_columns
from softdyn.words import listed, suggestion

Array = NDArray[np.float64]

KEYS: dict[str, tuple[str, ...]] = {
    "particles": ("positions", "file", "radii", "species"),
    "packing": ("kind", "count", "dimension", "fraction", "seed", "radii", "cells", "spacing"),
    "contacts": ("gap", "range", "tangential"),
    "box": ("lengths", "tilt", "depth"),
    "flow": ("shear_rate", "drag"),
    "stress": ("xy", "xx", "yy", "zz", "pressure", "viscosity"),
    "until": ("t", "strain"),
    "output": ("times",),
    "accuracy": ("rtol",),
}
#: What each entry of these lists must have, and what it may.
LISTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "push": (("particles",), ("force", "torque")),
    "hold": (("particles", "axes"), ("velocity", "spin")),
    "wall": (("point", "normal"), ("rigid", "velocity")),
}
#: Of packings.
KINDS = ("random", "square", "hexagonal", "cubic", "fcc")
OPEN = ("parameters", "mixing", "constants")
TOP_LEVEL = ("law", "target", *OPEN, *KEYS, *LISTS)


def stock_scenes() -> dict[str, Path]:
    """Scene files that come with softdyn, by name."""
    return {path.stem: path for path in sorted((Path(__file__).parent / "scenes").glob("*.toml"))}


def read_particle_scene(path: str | Path) -> ParticleScene:
    """Read a scene file of many particles.

    Raises
    ------
    SceneError
        If the file cannot be read, is not TOML (with the line), or holds an unknown or missing key.
    """
    path = Path(path)
    data = read_toml(path)
    try:
        return particle_scene_from(data, path.parent)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def particle_scene_from(data: Mapping[str, Any], folder: Path) -> ParticleScene:
    """Scene from the content of a scene file; paths in it are relative to ``folder``.

    Raises
    ------
    SceneError
        Listing unknown and missing keys.
    """
    if "pair" in data and not is_particle_scene(data):
        raise SceneError("it is a scene of two particles, with [pair]; here [particles] or [packing] is needed")
    faults = unknown_keys(data, TOP_LEVEL, "")
    for name in (*KEYS, *OPEN):
        content = data.get(name, {})
        if not isinstance(content, Mapping):
            faults.append(f"{name} must be a section, [{name}]")
        elif name in KEYS:
            faults += unknown_keys(content, KEYS[name], f"[{name}] ", TOP_LEVEL)
    for name, (required, optional) in LISTS.items():
        entries = data.get(name, [])
        if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
            faults.append(f"{name} must be a list of sections, [[{name}]]")
            continue
        for number, entry in enumerate(entries):
            faults += unknown_keys(entry, (*required, *optional), f"[[{name}]] {number} ", TOP_LEVEL)
            faults += [f"[[{name}]] {number}: {key} is missing" for key in required if key not in entry]
    missing = [key for key in ("law", "parameters", "until") if key not in data]
    faults += [f"[{key}] is missing" if key != "law" else 'law is missing: law = "NAME"' for key in missing]
    # a packing, or a result that is gone on from, has lengths of its own
    box = data.get("box")
    if isinstance(box, Mapping) and "lengths" not in box and set(box) != {"depth"}:
        faults.append("[box] lengths is missing, one for each axis; 0 along those that are not periodic")
    if ("particles" in data) == ("packing" in data):
        faults.append("[particles] and [packing] are two ways to say where the particles are: give one of them")
    if faults:
        raise SceneError(listed(faults))
    law = data["law"]
    if isinstance(law, str) and ".py" in law:
        law = str(folder / law)
    placed = _placed(data, folder)
    flow = data.get("flow", {})
    settings: dict[str, Any] = {
        "law": law,
        "target": data.get("target", "auto"),
        "parameters": data["parameters"],
        "mixing": data.get("mixing", {}),
        "constants": data.get("constants", {}),
        "gap": data.get("contacts", {}).get("gap"),
        "range": data.get("contacts", {}).get("range"),
        "tangential": data.get("contacts", {}).get("tangential", False),
        "shear_rate": _read(flow.get("shear_rate", 0.0), folder, "[flow]", "shear_rate"),
        "drag": flow.get("drag", 0.0),
        "stress": {
            name: _read(value, folder, "[stress]", name)
            for name, value in data.get("stress", {}).items()
            if name != "viscosity"
        },
        "stress_viscosity": data.get("stress", {}).get("viscosity"),
        "push": [Push(**entry) for entry in _entries(data, "push", ("force", "torque"), folder)],
        "hold": [Hold(**entry) for entry in _entries(data, "hold", ("velocity", "spin"), folder)],
        "wall": [Wall(**entry) for entry in _entries(data, "wall", ("velocity",), folder)],
        **_end(data["until"], flow, data.get("stress", {})),
        **placed,
    }
    settings |= {"times": data["output"]["times"]} if "times" in data.get("output", {}) else {}
    settings |= {"rtol": data["accuracy"]["rtol"]} if "rtol" in data.get("accuracy", {}) else {}
    if "depth" in data.get("box", {}):
        settings["depth"] = data["box"]["depth"]
    if "box" in data and set(data["box"]) != {"depth"}:
        if "box" in placed:
            source = "[packing]" if "packing" in data else "[particles] file"
            raise SceneError(f"[box] follows from {source}: leave it out, but for its depth")
        # TOML has no null: 0 stands for an axis that is not periodic
        lengths = _list("[box] lengths", data["box"]["lengths"])
        settings["box"] = [None if length == 0 else length for length in lengths]
        settings["tilt"] = data["box"].get("tilt", 0.0)
    return ParticleScene(**settings)


#: Headings of the tables of what changes, besides their own names; with _x and so on behind them, too.
HEADINGS = {
    "force": ("F",),
    "torque": ("T", "moment"),
    "velocity": ("v", "V"),
    "spin": ("omega", "angular_velocity"),
    "shear_rate": ("rate", "gamma_dot"),
    "pressure": ("p", "P"),
}


def _read(value: Any, folder: Path, where: str, name: str) -> Any:
    """What says how something changes, with the table that it names in its place."""
    if not isinstance(value, Mapping):
        return value
    if set(value) != {"file"} or not isinstance(value["file"], str):
        raise SceneError(f'{where} {name}: a table is {{file = "{name}.csv"}}, with no other key')
    also = HEADINGS.get(name, ("stress", "sigma", f"stress_{name}", f"sigma_{name}"))
    axes = [f"{heading}_{axis}" for heading in (name, *also) for axis in AXES] if name in HEADINGS else []
    return read_table(folder / value["file"], name, (*also, *axes))


def _entries(data: Mapping[str, Any], name: str, driven: Sequence[str], folder: Path) -> Iterator[Mapping[str, Any]]:
    """Entries of a list, with the tables that they name."""
    for number, entry in enumerate(data.get(name, [])):
        read = {
            key: [_read(value, folder, f"[[{name}]] {number}", key) for value in entry[key]]
            for key in driven
            if isinstance(entry.get(key), list)
        }
        yield {**entry, **read}


def _list(where: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise SceneError(f"{where} must be a list of numbers, not {value!r}")
    return value


def _end(until: Mapping[str, Any], flow: Mapping[str, Any], stress: Mapping[str, Any]) -> dict[str, Any]:
    if "xy" in stress:
        if "t" not in until:
            raise SceneError("[until] t is missing: under an imposed shear stress a strain may never be reached")
        return {"until_t": until["t"], "until_strain": until.get("strain")}
    if len(until) != 1:
        raise SceneError("[until] takes t or strain, one of them")
    if "t" in until:
        return {"until_t": until["t"]}
    rate, strain = flow.get("shear_rate", 0), until["strain"]
    if not isinstance(rate, (int, float)) or not rate:
        raise SceneError("[until] strain needs [flow] shear_rate, a number, or [stress] xy")
    if isinstance(strain, bool) or not isinstance(strain, (int, float)):
        raise SceneError(f"[until] strain must be a number, not {strain!r}")
    return {"until_t": strain / abs(rate)}


def _placed(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Positions, radii, species and box."""
    if "packing" in data:
        return _packed(data["packing"])
    particles = data["particles"]
    if ("file" in particles) == ("positions" in particles):
        raise SceneError("[particles] takes positions or file, one of them")
    if "file" in particles:
        if "radii" in particles or "species" in particles:
            raise SceneError("[particles] radii and species belong in the file")
        if not isinstance(particles["file"], str):
            raise SceneError(f"[particles] file must be a path, not {particles['file']!r}")
        return read_particles(folder / particles["file"])
    if "radii" not in particles:
        raise SceneError("[particles] radii is missing")
    placed = {"positions": particles["positions"], "radii": particles["radii"]}
    return {**placed, "species": particles["species"]} if "species" in particles else placed


def _packed(packing: Mapping[str, Any]) -> dict[str, Any]:
    kind = packing.get("kind", "random")
    if kind not in KINDS:
        raise SceneError(f"[packing] unknown kind {kind!r}{suggestion(kind, KINDS)}")
    wanted = ("count", "dimension", "fraction", "seed", "radii") if kind == "random" else ("cells", "spacing", "radii")
    missing = [key for key in wanted if key not in packing]
    other = [key for key in packing if key not in (*wanted, "kind")]
    if missing or other:
        raise SceneError(
            f"[packing] of kind {kind!r} takes {', '.join(wanted)}"
            + (f"; {', '.join(missing)} missing" if missing else "")
            + (f"; {', '.join(other)} unknown" if other else "")
        )
    radii = packing["radii"] if isinstance(packing["radii"], list) else [packing["radii"]]
    drawn = kind == "random" and isinstance(packing["radii"], Mapping)
    plain = all(isinstance(radius, (int, float)) and not isinstance(radius, bool) for radius in radii)
    if not drawn and (not radii or not plain):
        raise SceneError(f"[packing] radii must be a number, or a list of some, not {radii!r}")
    if kind != "random":
        spacing = packing["spacing"]
        if isinstance(spacing, bool) or not isinstance(spacing, (int, float)):
            raise SceneError(f"[packing] spacing must be a number, not {spacing!r}")
        x, lengths = lattice_packing(str(kind), _list("[packing] cells", packing["cells"]), float(spacing))
        size = np.array(radii, dtype=float)[np.arange(len(x)) % len(radii)]
        return {"positions": x, "radii": size, "box": list(lengths)}
    for key in ("count", "dimension", "seed"):
        if isinstance(packing[key], bool) or not isinstance(packing[key], int) or packing[key] < 0:
            raise SceneError(f"[packing] {key} must be a whole number, 0 or larger, not {packing[key]!r}")
    if isinstance(packing["fraction"], bool) or not isinstance(packing["fraction"], (int, float)):
        raise SceneError(f"[packing] fraction must be a number, not {packing['fraction']!r}")
    x, size, lengths = random_packing(
        packing["count"],
        packing["dimension"],
        float(packing["fraction"]),
        packing["radii"] if drawn else radii,
        packing["seed"],
    )
    return {"positions": x, "radii": size, "box": list(lengths)}


def read_particles(path: str | Path) -> dict[str, Any]:
    """Positions, radii, species and box from a file, as arguments of a :class:`ParticleScene`.

    Parameters
    ----------
    path : str or Path
        Of a result (.npz), whose last frame is taken with its films, or of a table with the headings x, y, z, radius
        and species in any order (y, z and species optional; ``diameter`` in the place of radius is twice that), see
        :mod:`softdyn.tables`.

    Returns
    -------
    dict
        ``positions`` (N, d), ``radii`` (N,); ``species``, ``box``, ``tilt``, ``depth`` and ``films`` if there are any.

    Raises
    ------
    SceneError
        Naming the line at fault.
    """
    path = Path(path)
    if path.suffix != ".npz":
        return _from_table(path)
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
