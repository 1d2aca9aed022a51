"""Many runs of scenes, each a task of its own whose result is a file.

A folder holds, for each run, by its number: ``NNNN.npz``, its result; or ``NNNN.failed.txt``, why there is none; while
it goes on, a checkpoint and frames. Whatever ends the work, carried out again it goes on: a result that is there is
kept, a run that has a checkpoint goes on from it to the last bit, one that failed is tried again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError, SoftdynError
from softdyn.results.state_file import remove
from softdyn.results.whole_files import written_whole
from softdyn.rheology.kinds import kind_of
from softdyn.scene.varied_content import with_values
from softdyn.sent_sources import laws_in
from softdyn.tasks import carried_out, is_begun

Array = NDArray[np.float64]
Content = dict[str, Any]
#: What a run is told when it ends: number of the run, runs done, runs in all, and why it failed or "".
Told = Callable[[int, int, int, str], None]

#: Runs at most, each a file.
MOST_RUNS = 100_000


@dataclass(frozen=True)
class Run:
    """A run that is to be made.

    Attributes
    ----------
    number : int
        From 0 on.
    values : mapping from str to float
        What is varied, by the names that were given.
    content : mapping
        Of its scene file.
    home : Path
        Paths in the content are relative to it.
    folder : Path
        Of the results.
    protocol : mapping
        What is done besides, in plain data; empty for a run of the scene alone.
    """

    number: int
    values: Mapping[str, float]
    content: Content
    home: Path
    folder: Path
    protocol: Mapping[str, Any] = field(default_factory=dict)

    @property
    def result(self) -> Path:
        """The file of its result."""
        return self.folder / f"{self.number:04d}.npz"

    @property
    def checkpoint(self) -> Path:
        """The file that it goes on from."""
        return self.folder / f"{self.number:04d}.checkpoint.npz"

    @property
    def failure(self) -> Path:
        """The file that tells why it failed."""
        return self.folder / f"{self.number:04d}.failed.txt"

    @property
    def words(self) -> str:
        """Its number, and what is varied."""
        varied = ", ".join(f"{name}={value:g}" for name, value in self.values.items())
        return f"run {self.number}{f' ({varied})' if varied else ''}"


def planned(
    content: Mapping[str, Any],
    home: Path,
    folder: Path,
    vary: Mapping[str, Array],
    build: Callable[[Content, Mapping[str, float]], Content] | None = None,
    protocol: Mapping[str, Any] | None = None,
) -> list[Run]:
    """All runs of a sweep: a scene for every combination of values, the last name fastest.

    Parameters
    ----------
    content : mapping
        Of the scene file.
    home, folder : Path
    vary : mapping from str to array
        Names of numbers of the scene (see :mod:`softdyn.scene.varied_content`), and of those that ``build`` takes.
    build : function of a content and the values, optional
        Makes the content of a run's scene; by default the numbers are put into their places.
    protocol : mapping, optional
        Of all runs.

    Raises
    ------
    SceneError
        If a name is unknown, a value is none that it takes, or there are too many runs.
    """
    count = math.prod(len(values) for values in vary.values())
    if not 1 <= count <= MOST_RUNS:
        raise SceneError(f"{count} runs: 1 to {MOST_RUNS} are made, each with a file of its own; vary fewer values")
    made = build or putting(content)
    runs = []
    for number, values in enumerate(product(*vary.values())):
        named = {name: float(value) for name, value in zip(vary, values, strict=True)}
        runs.append(Run(number, named, made(dict(content), named), home, folder, protocol or {}))
    return runs


def putting(content: Mapping[str, Any]) -> Callable[[Content, Mapping[str, float]], Content]:
    """What puts numbers into their places in the content of a scene of this kind."""
    scene = kind_of(content).scene
    return lambda given, values: with_values(scene, given, values)


def begin(runs: Sequence[Run]) -> None:
    """Make the folder ready, and refuse one that holds the results of other runs.

    Raises
    ------
    SceneError
        Also if the first scene cannot be used.
    """
    first = runs[0]
    kind_of(first.content).read(first.content, first.home)
    is_begun(first.folder, _identity(runs))


def _identity(runs: Sequence[Run]) -> str:
    """Digest of all scenes, their law, the files that they name, and the tool."""
    from softdyn.derive.law import law_hash
    from softdyn.kernels import tool_digest
    from softdyn.laws import law_of

    content, home = runs[0].content, runs[0].home
    law = content.get("law")
    # flows have none
    found = law_hash(law_of(str(home / law) if ".py" in law else law)) if isinstance(law, str) else "none"
    files = {name: _digest(home / name) for name in sorted(set(_named(content)))}
    given = [found, tool_digest(), files, [[dict(run.values), run.content, dict(run.protocol)] for run in runs]]
    return sha256(json.dumps(given, default=str, sort_keys=True).encode()).hexdigest()


def _named(content: Any) -> list[str]:
    """All files that a scene names: data, and those that declare something."""
    if isinstance(content, Mapping):
        own = [value for name, value in content.items() if name == "file" and isinstance(value, str)]
        return own + [name for value in content.values() for name in _named(value)]
    if isinstance(content, list):
        return [name for value in content for name in _named(value)]
    if isinstance(content, str) and ".py" in content:
        return [content.rpartition(":")[0] if ".py:" in content else content]
    return []


def _digest(path: Path) -> str:
    try:
        return sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError):
        return "none"  # the run that needs it says so


def carry_out(
    runs: Sequence[Run],
    *,
    scheduler: str | None = None,
    told: Told | None = None,
    only: int | None = None,
    work: Callable[[Run], str] | None = None,
) -> dict[int, str]:
    """Make the runs whose results are not there yet.

    Parameters
    ----------
    runs : sequence of Run
    scheduler : str, optional
        Address of a Dask scheduler, whose workers see the folder under the same name; else a pool of processes.
    told : function, optional
    only : int, optional
        Number of the one run that is to be made.
    work : function of a Run, optional
        Makes one, and returns why it failed, or ""; :func:`make` by default.

    Returns
    -------
    dict from int to str
        Why runs failed, by their numbers.

    Raises
    ------
    SceneError
    """
    begin(runs)
    wanted = runs if only is None else [runs[only]]
    missing = [run for run in wanted if not run.result.is_file()]
    done = len(wanted) - len(missing)
    failed: dict[int, str] = {}
    if len(missing) > 1:
        _prepared(missing)
    laws: list[str] = []
    if scheduler is not None:  # workers have folders of their own
        missing = [replace(run, home=run.home.absolute(), folder=run.folder.absolute()) for run in missing]
        laws = [law for run in missing[:1] for law in laws_in(run.content, run.home)]
    for run, words in carried_out(work or make, missing, scheduler, laws=laws):
        done += 1
        if words:
            failed[run.number] = words
        if told is not None:
            told(run.number, done, len(wanted), words)
    return failed


def _prepared(runs: Sequence[Run]) -> None:
    """Derive and compile once, before all workers want to."""
    for run in runs:
        try:
            kind = kind_of(run.content)
            kind.ready(kind.read(run.content, run.home))
            return
        except SoftdynError:
            continue  # it says so itself, by name


def make(run: Run) -> str:
    """Make one run, and write its result; returns why it failed, or "".

    Only what concerns this run is caught: an interrupt, or a lack of memory, ends all of them.
    """
    try:
        kind = kind_of(run.content)
        result = kind.simulate(kind.read(run.content, run.home), None, run.checkpoint, True, True)
        result.save(run.result)
    except SoftdynError as error:
        words = str(error)
        with written_whole(run.failure) as temporary:
            temporary.write_text(words + "\n", encoding="utf-8")
        return words
    run.failure.unlink(missing_ok=True)
    remove(run.checkpoint)
    return ""


def states(runs: Sequence[Run]) -> tuple[list[Run], dict[int, str], list[int]]:
    """Runs that are done, why others failed, and the numbers of those that are not made."""
    done = [run for run in runs if run.result.is_file()]
    failed = {
        run.number: run.failure.read_text(encoding="utf-8").strip()
        for run in runs
        if not run.result.is_file() and run.failure.is_file()
    }
    made = {run.number for run in done} | set(failed)
    return done, failed, [run.number for run in runs if run.number not in made]


def array_script(command: Sequence[str], count: int, name: str) -> str:
    """A script for SLURM: an array job, one command a run, and how all is gathered.

    Parameters
    ----------
    command : sequence of str
        That makes all runs here; ``--task N`` is added to make one, ``--gather`` to gather all.
    count : int
        How many runs.
    name : str
        Of the job.
    """
    import shlex

    quoted = shlex.join(command)
    return (
        "#!/bin/bash\n"
        f"# {count} runs, one a task; a task that is stopped goes on where it was: submit the script again.\n"
        "# Submit it from this folder; when all tasks have ended, gather their results:\n"
        f"#   {quoted} --gather\n"
        f"#SBATCH --job-name={shlex.quote(name)}\n"
        f"#SBATCH --array=0-{count - 1}\n"
        "#SBATCH --cpus-per-task=1\n"
        "#SBATCH --requeue\n"
        "export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}\n"
        f'exec {quoted} --task "$SLURM_ARRAY_TASK_ID"\n'
    )
