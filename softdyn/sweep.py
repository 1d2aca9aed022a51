"""Sweeps: one scene, many values of some of its numbers, in parallel, in parts that survive an interrupt.

A part is a range of runs. Its results are written to a file of its own, whole or not at all, as soon as they are there;
a sweep that goes on after an interrupt skips the parts that it finds. A part is made from its number alone, so that one
made twice, by a worker that died and one that took over, counts once.
"""

from __future__ import annotations

import itertools
import json
import math
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from hashlib import sha256
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError, SoftdynError
from softdyn.kernels import Kernel, get_kernel, tool_digest
from softdyn.laws import law_of
from softdyn.pair import simulate_pair
from softdyn.results import written_whole
from softdyn.scene import LARGEST_COUNT, Scene, Table, named_numbers, suggestion

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Runs in a part: a few tenths of a second of work.
PART = 250
_RANGE = re.compile(r"(linspace|logspace)\(([^,()]+),([^,()]+),([^,()]+)\)")


@dataclass(frozen=True)
class Sweep:
    """What a sweep gave, one row for each run.

    Attributes
    ----------
    varied : mapping from str to array, shape (runs,)
        The values that were varied, in every combination, the last name fastest.
    arrays : mapping from str to array, shape (runs, outputs)
        As in a :class:`PairResult`; nan where a run failed, or ended before an output time.
    errors : mapping from int to str
        Why a run failed, by its number.
    """

    varied: Mapping[str, Array]
    arrays: Mapping[str, Array]
    errors: Mapping[int, str]

    def save(self, path: Path) -> Path:
        """Write to .npz, or to .csv as one table with a line for each output of each run.

        Names of what was varied start with "varied_" in both.

        Raises
        ------
        SceneError
            If the ending is another, or the file cannot be written.
        """
        if path.suffix not in (".npz", ".csv"):
            raise SceneError(f"cannot save to {path}: the ending of a sweep's table must be .npz or .csv")
        with written_whole(path) as temporary:
            if path.suffix == ".npz":
                with temporary.open("wb") as file:
                    errors = np.array(json.dumps({str(run): text for run, text in self.errors.items()}))
                    content: dict[str, Any] = {f"varied_{name}": values for name, values in self.varied.items()}
                    np.savez(file, errors=errors, **(content | dict(self.arrays)))
            else:
                outputs = next(iter(self.arrays.values())).shape[1]
                columns = [np.repeat(values, outputs) for values in self.varied.values()]
                table = np.column_stack([*columns, *(values.ravel() for values in self.arrays.values())])
                heads = ",".join([*(f"varied_{name}" for name in self.varied), *self.arrays])
                np.savetxt(temporary, table, delimiter=",", header=heads, comments="", fmt="%.17g")
        return path


def read_values(text: str) -> tuple[str, Array]:
    """Read NAME=logspace(a,b,n), NAME=linspace(a,b,n) or NAME=x,y,z.

    Raises
    ------
    SceneError
    """
    name, equals, values = (part.strip() for part in text.partition("="))
    try:
        if not equals or not name:
            raise ValueError
        match = _RANGE.fullmatch(values.replace(" ", ""))
        if match is None:
            return name, np.array([float(value) for value in values.split(",")])
        count = int(match[4])
        if not 1 <= count <= LARGEST_COUNT:
            raise ValueError
        return name, getattr(np, match[1])(float(match[2]), float(match[3]), count)
    except ValueError:
        raise SceneError(
            f"--vary {text}: NAME=logspace(a,b,n) (10**a to 10**b), NAME=linspace(a,b,n) or NAME=x,y,... is expected"
        ) from None


def read_varied(texts: Sequence[str]) -> dict[str, Array]:
    """Read several of these, each for a name of its own.

    Raises
    ------
    SceneError
    """
    pairs = [read_values(text) for text in texts]
    names = [name for name, _ in pairs]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise SceneError(f"--vary {twice[0]} is given twice; list all of its values in one: {twice[0]}=x,y,...")
    return dict(pairs)


def sweep(
    scene: Scene,
    vary: Mapping[str, Sequence[float] | Array],
    *,
    folder: Path | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Run a scene for every combination of the values given.

    Parameters
    ----------
    scene : Scene
        With [output] times or gaps; without, the end of each run is its only output.
    vary : mapping from str to sequence of float
        A parameter of the law, a constant of the drive, "h", "delta", "force", "velocity", or "kappa", which stands for
        a constant force kappa E R^2.
    folder : Path, optional
        Where parts are kept until all are there; a sweep that was interrupted goes on from what it finds.
    scheduler : str, optional
        Address of a Dask scheduler; else a pool of this machine's own.
    progress : function of (runs done, runs), optional

    Raises
    ------
    SceneError
        If a name cannot be varied, ``folder`` holds the parts of another sweep or damaged ones, or the scheduler cannot
        be reached.
    """
    named_numbers("[parameters]", scene.parameters)
    named_numbers("[drive] constants", scene.constants)
    values = {name: np.atleast_1d(np.asarray(given, dtype=float)) for name, given in vary.items()}
    for name in values:
        varied_scene(scene, {name: float(values[name].flat[0])})
    runs = math.prod(len(given) for given in values.values())
    parts = range(0, runs, PART)
    done: dict[int, dict[str, Any]] = {}
    if folder is not None:
        done = _found(folder, _identity(scene, values), set(parts))
    missing = [first for first in parts if first not in done]
    tasks = [(scene, values, first, min(first + PART, runs)) for first in missing]
    if tasks:
        run_part((scene, values, 0, 1))  # derive and compile once, before all workers want to
    for first, part in _made(tasks, scheduler):
        done[first] = part
        if folder is not None:
            with written_whole(folder / f"{first}.json") as temporary:
                temporary.write_text(json.dumps(part), encoding="utf-8")
        if progress is not None:
            progress(min(len(done) * PART, runs), runs)
    result = _joined(values, [done[first] for first in parts])
    if folder is not None:
        shutil.rmtree(folder)
    return result


def varied_scene(scene: Scene, point: Mapping[str, float]) -> Scene:
    """A scene with some of its numbers replaced.

    Raises
    ------
    SceneError
        If it has no such number.
    """
    for name, value in point.items():
        if name in scene.parameters:
            scene = replace(scene, parameters={**scene.parameters, name: value})
        elif name in scene.constants:
            scene = replace(scene, constants={**scene.constants, name: value})
        elif name in ("h", "delta", "force", "velocity"):
            change: dict[str, Any] = {name: value}
            scene = replace(scene, **change)
        elif name == "kappa" and scene.force is not None and {"E", "R"} <= set(scene.parameters):
            force = value * float(scene.parameters["E"]) * float(scene.parameters["R"]) ** 2
            scene = replace(scene, force=force, constants={})
        elif name == "kappa":
            raise SceneError("kappa stands for a force kappa E R^2: give the scene a force, E and R, or vary another")
        else:
            known = [*scene.parameters, *scene.constants, "h", "delta", "force", "velocity", "kappa"]
            raise SceneError(f"{name!r} cannot be varied in this scene{suggestion(name, known)}")
    return scene


def _points(values: Mapping[str, Array], first: int, last: int) -> Iterator[dict[str, float]]:
    # parameters come before kappa, which is made of them
    for number in range(first, last):
        at = np.unravel_index(number, tuple(len(given) for given in values.values()))
        point = {name: float(given[i]) for (name, given), i in zip(values.items(), at, strict=True)}
        yield dict(sorted(point.items(), key=lambda item: item[0] == "kappa"))


def run_part(task: tuple[Scene, Mapping[str, Array], int, int]) -> dict[str, Any]:
    """Make the runs of a part: plain data, lists of numbers by name, and errors by the number of the run."""
    scene, values, first, last = task
    kernels: dict[str, Kernel] = {}

    def kernel_of(law: Any, target: str, **needs: Any) -> Kernel:
        """Look a kernel up once for each shape of scene, of which a sweep has one or two."""
        shape = repr(needs)
        if shape not in kernels:
            kernels[shape] = get_kernel(law, target, **needs)
        return kernels[shape]

    rows: list[dict[str, list[float]]] = []
    errors: dict[str, str] = {}
    for number, point in enumerate(_points(values, first, last), start=first):
        try:
            result = simulate_pair(varied_scene(scene, point), kernel_of=kernel_of)
            keep = slice(None) if scene.times is not None or scene.gaps is not None else slice(-1, None)
            rows.append({name: array[keep].tolist() for name, array in result.arrays.items()})
        except SoftdynError as error:
            errors[str(number)] = str(error)
            rows.append({})
    return {"rows": rows, "errors": errors}


def _made(tasks: Sequence[Any], scheduler: str | None) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield each part as it is made, with the number of its first run."""
    if scheduler is not None:
        try:
            from distributed import Client
            from distributed import as_completed as dask_completed
        except ImportError:
            raise SceneError("--scheduler needs Dask: pip install 'softdyn[cluster]'") from None
        try:
            client = Client(scheduler)
        except (OSError, ValueError) as error:
            raise SceneError(f"--scheduler {scheduler}: no Dask scheduler is reached there: {error}") from None
        with client:
            futures = {client.submit(run_part, task, pure=False, retries=3): task[2] for task in tasks}
            for future in dask_completed(futures):
                yield futures[future], future.result()
        return
    if len(tasks) <= 1:
        yield from ((task[2], run_part(task)) for task in tasks)
        return
    # a fresh process knows nothing of threads that the caller may have
    with ProcessPoolExecutor(max_workers=min(cpu_count() or 1, len(tasks)), mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(run_part, task): task[2] for task in tasks}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _identity(scene: Scene, values: Mapping[str, Array]) -> str:
    """Digest of what a sweep is, with its law, so that parts of one are not taken for those of another."""
    from softdyn.derive.law import law_hash

    law = law_hash(law_of(scene.law))
    given = {name: array.tolist() for name, array in values.items()}
    content = [law, tool_digest(), {**vars(scene), "law": None}, given, PART]
    return sha256(json.dumps(content, default=_as_data, sort_keys=True).encode()).hexdigest()


def _as_data(value: Any) -> Any:
    """Tables and arrays as lists; their representations leave numbers out."""
    if isinstance(value, Table):
        return [value.t.tolist(), value.F.tolist()]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else repr(value)


def _found(folder: Path, identity: str, parts: set[int]) -> dict[int, dict[str, Any]]:
    """Parts that an interrupted sweep left in its folder; starts one that there is not."""
    note = folder / "sweep.json"
    if not note.is_file():
        with written_whole(note) as temporary:
            temporary.write_text(json.dumps({"identity": identity}), encoding="utf-8")
        return {}
    if _read_part(note, ("identity",))["identity"] != identity:
        raise SceneError(
            f"{folder} holds parts of another sweep, or of this one before its scene, its law or softdyn itself "
            "changed: finish that one, delete the folder, or name another"
        )
    files = {int(path.stem): path for path in folder.glob("*.json") if path.stem.isdigit()}
    return {first: _read_part(path, ("rows", "errors")) for first, path in files.items() if first in parts}


def _read_part(path: Path, keys: Sequence[str]) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror}") from None
    except ValueError:  # neither UTF-8 nor JSON
        content = None
    if not isinstance(content, dict) or not set(keys) <= set(content):
        raise SceneError(f"{path} is damaged: delete the folder {path.parent}, and run the sweep again")
    return content


def _joined(values: Mapping[str, Array], parts: Sequence[Mapping[str, Any]]) -> Sweep:
    rows = list(itertools.chain.from_iterable(part["rows"] for part in parts))
    errors = {int(run): text for part in parts for run, text in part["errors"].items()}
    names = next((list(row) for row in rows if row), ["t", "h", "delta"])
    outputs = max((len(row["t"]) for row in rows if row), default=0)
    arrays = {name: np.full((len(rows), outputs), math.nan) for name in names}
    for number, row in enumerate(rows):
        for name, content in row.items():
            arrays[name][number, : len(content)] = content
    meshes = np.meshgrid(*values.values(), indexing="ij")
    return Sweep({name: mesh.ravel() for name, mesh in zip(values, meshes, strict=True)}, arrays, errors)
