"""Sweeps: one scene, many values of some of its numbers, in parallel, in parts that survive an interrupt.

A part is a range of runs. Its results are written to a file of its own, whole or not at all, as soon as they are there;
a sweep that goes on after an interrupt skips the parts that it finds. A part is made from its number alone, so that one
made twice, by a worker that died and one that took over, counts once.
"""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.archive import read_arrays, read_json
from softdyn.errors import SceneError
from softdyn.kernels import tool_digest
from softdyn.laws import law_of
from softdyn.pair.batch import Batch, as_arrays, is_plain, simulate_batch, varied_scene
from softdyn.results.whole_files import written_whole
from softdyn.scene.numbers import named_numbers
from softdyn.scene.pair_scene import Scene
from softdyn.scene.time_tables import Table
from softdyn.tasks import carried_out, damaged, is_begun

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

#: Runs in a part, a few tenths of a second of work: of runs that are made one by one, and of those that are not.
PART = 250
PLAIN_PART = 5000
#: Runs of a sweep at most: a quarter of an hour, where they take least.
MOST_RUNS = 10**8


def sweep(
    scene: Scene,
    vary: Mapping[str, Sequence[float] | Array],
    *,
    folder: Path | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Batch:
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
        If a name cannot be varied, there is no room for so many runs, ``folder`` holds the parts of another sweep or
        damaged ones, or the scheduler cannot be reached.
    """
    named_numbers("[parameters]", scene.parameters)
    named_numbers("[constants]", scene.constants)
    values = {name: np.atleast_1d(np.asarray(given, dtype=float)) for name, given in vary.items()}
    for name in values:
        if values[name].ndim != 1 or not len(values[name]):
            raise SceneError(f"{name} is varied over a list of numbers, one at least, not over {vary[name]!r}")
        varied_scene(scene, {name: float(values[name][0])})
    runs = math.prod(len(given) for given in values.values())
    require_room(scene, values, folder)
    size = PLAIN_PART if is_plain(scene) else PART
    parts = range(0, runs, size)
    done: dict[int, Batch] = {}
    if folder is not None:
        done = _found(folder, _identity(scene, values), set(parts))
    missing = [first for first in parts if first not in done]
    tasks = [(scene, values, first, min(first + size, runs)) for first in missing]
    if len(tasks) > 1 and not is_plain(scene):
        run_part((scene, values, 0, 1))  # derive and compile once, before all workers want to
    laws = [str(scene.law)] if isinstance(scene.law, (str, Path)) else []
    for (_, _, first, _), part in carried_out(run_part, tasks, scheduler, alone=is_plain(scene), laws=laws):
        done[first] = part
        if folder is not None:
            with written_whole(folder / f"{first}.npz") as temporary, temporary.open("wb") as file:
                np.savez(file, **as_arrays(part))
        if progress is not None:
            progress(min(len(done) * size, runs), runs)
    result = _joined([(first, done[first]) for first in parts])
    if folder is not None:
        shutil.rmtree(folder)
    return result


def size_of(scene: Scene, values: Mapping[str, Sequence[float] | Array]) -> tuple[int, int, int]:
    """Runs of a sweep, outputs of each, and bytes of the table of all."""
    runs = math.prod(len(given) for given in values.values())
    asked = scene.times if scene.times is not None else scene.gaps
    outputs = 1 if asked is None else int(asked) if isinstance(asked, (int, np.integer)) else len(asked)
    return runs, outputs, 8 * runs * (outputs * (3 + len(scene.quantities)) + len(values))


def in_words(scene: Scene, values: Mapping[str, Sequence[float] | Array]) -> str:
    """How large a sweep is."""
    runs, outputs, size = size_of(scene, values)
    of_each = f", {outputs} outputs of each" if outputs > 1 else ""
    return f"{runs} runs{of_each}: a table of {_bytes(size)}, twice that in memory and on disk on the way"


def require_room(scene: Scene, values: Mapping[str, Sequence[float] | Array], folder: Path | None) -> None:
    """Refuse a sweep that is too large for this machine, before its first run.

    Parameters
    ----------
    scene : Scene
    values : mapping from str to sequence of float
        The numbers that each key takes.
    folder : Path, optional
        Where results are written.

    Raises
    ------
    SceneError
    """
    runs, _, size = size_of(scene, values)
    if runs > MOST_RUNS:
        raise SceneError(f"{in_words(scene, values)}; at most {MOST_RUNS} are made at once: vary fewer values")
    memory = _memory()
    if 2 * size > memory:
        raise SceneError(
            f"{in_words(scene, values)}, and this machine has {_bytes(memory)} of memory: vary fewer values, or ask "
            "for fewer outputs"
        )
    if folder is not None:
        there = next((one for one in folder.absolute().parents if one.is_dir()), None)
        free = math.inf if there is None else shutil.disk_usage(there).free
        if 2 * size > free:
            raise SceneError(f"{in_words(scene, values)}, and {there} has {_bytes(free)} free: name another place")


def _memory() -> float:
    """Bytes of memory of this machine; inf where it does not say."""
    try:
        return float(os.sysconf("SC_PHYS_PAGES")) * float(os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def _bytes(size: float) -> str:
    for unit, of_it in (("GB", 1e9), ("MB", 1e6)):
        if size >= of_it:
            return f"{size / of_it:.3g} {unit}"
    return f"{size / 1e3:.3g} kB"


def run_part(task: tuple[Scene, Mapping[str, Array], int, int]) -> Batch:
    """Make the runs of a part, every combination of the values from one number to another."""
    scene, values, first, last = task
    at = np.unravel_index(np.arange(first, last), tuple(len(given) for given in values.values()))
    return simulate_batch(scene, {name: given[i] for (name, given), i in zip(values.items(), at, strict=True)})


def _identity(scene: Scene, values: Mapping[str, Array]) -> str:
    """Digest of what a sweep is, with its law, so that parts of one are not taken for those of another."""
    from softdyn.derive.law import law_hash

    law = law_hash(law_of(scene.law))
    given = {name: array.tolist() for name, array in values.items()}
    content = [law, tool_digest(), {**vars(scene), "law": None}, given, PART, PLAIN_PART]
    return sha256(json.dumps(content, default=_as_data, sort_keys=True).encode()).hexdigest()


def _as_data(value: Any) -> Any:
    """Tables and arrays as lists; their representations leave numbers out."""
    if isinstance(value, Table):
        return [value.t.tolist(), value.F.tolist()]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else repr(value)


def _found(folder: Path, identity: str, parts: set[int]) -> dict[int, Batch]:
    """Parts that an interrupted sweep left in its folder; starts one that there is not."""
    if not is_begun(folder, identity):
        return {}
    files = {int(path.stem): path for path in folder.glob("*.npz") if path.stem.isdigit()}
    return {first: _read_part(path) for first, path in files.items() if first in parts}


def _read_part(path: Path) -> Batch:
    try:
        arrays = read_arrays(path)
        texts = [read_json(str(arrays.pop(name))) for name in ("errors", "warnings")]
        errors, warnings = ({int(run): text for run, text in of.items()} for of in texts)
    except (OSError, ValueError, LookupError, AttributeError, TypeError):
        raise SceneError(damaged(path)) from None
    varied = {name.removeprefix("varied_"): arrays.pop(name) for name in list(arrays) if name.startswith("varied_")}
    return Batch(varied, arrays, errors, {run: tuple(words) for run, words in warnings.items()})


def _joined(parts: Sequence[tuple[int, Batch]]) -> Batch:
    """One batch of all parts, each with the number of its first run."""
    names = max((list(part.arrays) for _, part in parts), key=len)
    outputs = max(part.arrays["t"].shape[1] for _, part in parts)

    def column(name: str) -> Array:
        padded = []
        for _, part in parts:
            values = part.arrays.get(name, np.empty((len(part), 0)))
            padded.append(np.pad(values, ((0, 0), (0, outputs - values.shape[1])), constant_values=math.nan))
        return np.concatenate(padded)

    return Batch(
        {name: np.concatenate([part.varied[name] for _, part in parts]) for name in parts[0][1].varied},
        {name: column(name) for name in names},
        {first + run: text for first, part in parts for run, text in part.errors.items()},
        {first + run: words for first, part in parts for run, words in part.warnings.items()},
    )
