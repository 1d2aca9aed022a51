"""Independent tasks, on this machine's processors or on a Dask cluster, and the folder in which their results wait."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import TypeVar

from softdyn.archive import read_json
from softdyn.errors import SceneError
from softdyn.results.whole_files import written_whole
from softdyn.signals import Terminated

Task = TypeVar("Task")
Found = TypeVar("Found")


def carried_out(
    work: Callable[[Task], Found],
    tasks: Sequence[Task],
    scheduler: str | None,
    *,
    alone: bool = False,
    laws: Sequence[str] = (),
) -> Iterator[tuple[Task, Found]]:
    """Carry out tasks, and yield each with what it gave, as soon as it is done.

    Parameters
    ----------
    work : function of a task
        Of a module's top level; its results depend on the task alone.
    tasks : sequence
    scheduler : str, optional
        Address of a Dask scheduler; else a pool of this machine's own processes. A task whose worker is lost is carried
        out by another one.
    alone : bool
        Whether this process carries out all of them, one after the other.
    laws : sequence of str
        Those that the tasks name: their files go with the tasks to other machines.

    Raises
    ------
    SceneError
        If the scheduler cannot be reached, or a worker would compute another law.
    """
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
        from softdyn.sent_sources import sources, with_sources

        with client:
            given = sources(laws)
            futures = {client.submit(with_sources, work, task, given, pure=False, retries=3): task for task in tasks}
            for future in dask_completed(futures):
                yield futures[future], future.result()
        return
    if len(tasks) <= 1 or alone:
        yield from ((task, work(task)) for task in tasks)
        return
    others = set(active_children())
    # a fresh process knows nothing of threads that the caller may have
    with ProcessPoolExecutor(max_workers=min(os.cpu_count() or 1, len(tasks)), mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(_in_worker, work, task): task for task in tasks}
        try:
            for done in as_completed(waiting):
                yield waiting[done], done.result()
        except BaseException as error:
            pool.shutdown(wait=False, cancel_futures=True)
            if not isinstance(error, KeyboardInterrupt) or isinstance(error, Terminated):
                # an interrupt from a terminal reaches them, too; this one they have to be told of
                for child in set(active_children()) - others:
                    child.terminate()
            raise


_interrupted = False


def _in_worker(work: Callable[[Task], Found], task: Task) -> Found:
    """Carry out a task in a process of the pool; one that was interrupted takes no other, though some may wait."""
    global _interrupted
    if _interrupted:
        raise KeyboardInterrupt
    try:
        return work(task)
    except KeyboardInterrupt:
        _interrupted = True
        raise


def is_begun(folder: Path, identity: str) -> bool:
    """Whether a folder holds results of these tasks already; where there is none, it is made.

    Parameters
    ----------
    folder : Path
    identity : str
        Digest of what the tasks are.

    Raises
    ------
    SceneError
        If it holds those of others, or is damaged.
    """
    note = folder / "sweep.json"
    if not note.is_file():
        with written_whole(note) as temporary:
            temporary.write_text(json.dumps({"identity": identity}), encoding="utf-8")
        return False
    try:
        known = read_json(note.read_text(encoding="utf-8"))["identity"]
    except (OSError, ValueError, LookupError, TypeError):
        raise SceneError(damaged(note)) from None
    if known != identity:
        raise SceneError(
            f"{folder} holds parts of another sweep, or of this one before its scene, its law or softdyn itself "
            "changed: finish that one, delete the folder, or name another"
        )
    return True


def damaged(path: Path) -> str:
    """Words about a file of such a folder that cannot be read."""
    return f"{path} is damaged: delete the folder {path.parent}, and run the sweep again"
