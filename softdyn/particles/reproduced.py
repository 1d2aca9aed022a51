"""What the commands that reproduce a figure have in common: they go through runs, and write what they found."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from tqdm import tqdm

from softdyn.results.whole_files import written_whole
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


def write_found(
    folder: Path,
    files: tuple[str, str, str],
    found: Found,
    table: Callable[[Found], Iterable[str]],
    draw: Callable[[Found], Figure],
) -> None:
    """Write what was found as two pictures and a table, and say where.

    Parameters
    ----------
    folder : Path
    files : three names of files
        Of the pictures, and of the table.
    found : what the runs gave
    table, draw : callables
        Give the lines of the table, and the picture.

    Raises
    ------
    SceneError
        If a file cannot be written.
    """
    from softdyn.study import figures

    *pictures, lines = files
    with written_whole(folder / lines) as temporary:
        temporary.write_text("\n".join(table(found)) + "\n", encoding="utf-8")
    with figures.paper_style():
        figure = draw(found)
        for name in pictures:
            figures.save(figure, folder / name)
    print(f"\nwritten to {folder}: {', '.join(files)}")
