"""A report of what was measured: where and when, and its three files; of ``softdyn bench`` and ``softdyn stress``."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import softdyn
from softdyn.results.whole_files import require_folder, written_whole


def heading(command: str, versions: dict[str, str]) -> dict[str, Any]:
    """When, with what and on which machine a report was made; versions are those of other packages."""
    return {
        "made": time.strftime("%Y-%m-%d"),
        "command": command,
        "machine": f"{platform.machine()}, {_processor()}",
        "versions": {"softdyn": softdyn.__version__, "python": platform.python_version(), **versions},
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"


@contextmanager
def told(folder: Path, name: str) -> Iterator[Callable[[str], None]]:
    """Tell line by line what ``softdyn bench NAME`` measures, on stdout and in ``NAME.txt`` in a folder.

    Until all is there the file is ``NAME.partial.txt``.

    Raises
    ------
    SceneError
        If the folder cannot be written to, which is seen before anything is measured.
    """
    require_folder(folder)
    partial = folder / f"{name}.partial.txt"
    command = f"softdyn bench {name}"
    lines = [f"{command}, {{made}}, {{machine}}".format(**heading(command, {}))]

    def tell(line: str) -> None:
        print(line, flush=True)
        lines.append(line)
        with written_whole(partial) as temporary:
            text = "\n".join([lines[0], "PARTIAL: not all is measured", *lines[1:]])
            temporary.write_text(text + "\n", encoding="utf-8")

    yield tell
    with written_whole(folder / f"{name}.txt") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    partial.unlink(missing_ok=True)


def partial_record(folder: Path, name: str) -> Path:
    """File that holds what a benchmark has measured before it is done."""
    return folder / f"{name}.partial.json"


def keep(folder: Path, name: str, report: dict[str, Any], text: str) -> None:
    """Write what there is of a report, beside one that an earlier benchmark may have left.

    Parameters
    ----------
    folder : Path
    name : str
        Of the benchmark: the files are name.partial.json and name.partial.txt.
    report : dict
        Plain data.
    text : str
        The same in words.
    """
    for suffix, content in ((".json", json.dumps(report, indent=1) + "\n"), (".txt", text)):
        with written_whole(partial_record(folder, name).with_suffix(suffix)) as temporary:
            temporary.write_text(content, encoding="utf-8")


def forget(folder: Path, name: str) -> None:
    """Remove what :func:`keep` wrote: the report is done."""
    for suffix in (".json", ".txt"):
        partial_record(folder, name).with_suffix(suffix).unlink(missing_ok=True)


def write_record(
    folder: Path, name: str, report: dict[str, Any], text: str, draw: Callable[[dict[str, Any]], Any]
) -> None:
    """Write a report as name.json and name.txt, and then its picture as name.png, into a folder.

    Parameters
    ----------
    folder : Path
    name : str
        Of the files, without the ending.
    report : dict
        Plain data.
    text : str
        The same in words.
    draw : function of a report
        Returns a figure of matplotlib.
    """
    for file, content in ((f"{name}.json", json.dumps(report, indent=1) + "\n"), (f"{name}.txt", text)):
        with written_whole(folder / file) as temporary:
            temporary.write_text(content, encoding="utf-8")
    figure = draw(report)
    with written_whole(folder / f"{name}.png") as temporary:
        figure.savefig(temporary, format="png", dpi=110)
