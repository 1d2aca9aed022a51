"""What the commands that reproduce a figure have in common: they go through runs, and write what they found."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from tqdm import tqdm

from softdyn.results.whole_files import require_folder, written_whole
from softdyn.terminal import as_it_is

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Run = TypeVar("Run")
Found = TypeVar("Found")


def told(runs: Sequence[Run], progress: bool) -> Iterable[Run]:
    """Runs one after the other, with a bar where there is a terminal and ``progress`` is asked for."""
    bar: Iterable[Run] = tqdm(
        runs, desc="runs", unit="run", leave=False, file=as_it_is(sys.stderr), disable=None if progress else True
    )
    return bar


def reproduce(
    folder: Path,
    files: tuple[str, str, str],
    measure: Callable[[], Found],
    summary: Callable[[Found], Iterable[str]],
    table: Callable[[Found], Iterable[str]],
    draw: Callable[[Found], Figure],
) -> int:
    """Make the runs, print what they gave, write it as two pictures and a table, and say where.

    Parameters
    ----------
    folder : Path
    files : three names of files
        Of the pictures, and of the table.
    measure : callable
        Makes the runs.
    summary, table, draw : callables
        Give the lines to print, those of the table, and the picture.

    Returns
    -------
    int
        0, the status of the command.

    Raises
    ------
    SceneError
        If the folder cannot be written to: before any run.
    """
    from softdyn.study import figures

    require_folder(folder)
    found = measure()
    print("\n".join(summary(found)))
    *pictures, lines = files
    with written_whole(folder / lines) as temporary:
        temporary.write_text("\n".join(table(found)) + "\n", encoding="utf-8")
    with figures.paper_style():
        figure = draw(found)
        for name in pictures:
            figures.save(figure, folder / name)
    print(f"\nwritten to {folder}: {', '.join(files)}")
    return 0
