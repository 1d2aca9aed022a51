"""``softdyn sweep`` of a scene whose runs are long, and what all commands share that make many runs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from softdyn.errors import SceneError
from softdyn.rheology.curves import Curves
from softdyn.rheology.options import runs_folder
from softdyn.rheology.run_table import ENDINGS, RunTable, gathered, measured_run
from softdyn.rheology.runs import Content, Run, array_script, carry_out, planned
from softdyn.scene.reading import is_fluid_scene, is_particle_scene, read_toml
from softdyn.varied import read_varied

PICTURES = (".png", ".svg", ".pdf")
#: Of so many runs each that ends is told.
EACH = 50
#: Runs that fail, or are not steady, that are told one by one.
TOLD = 10


def require_table(output: Path) -> None:
    """Refuse an output of another format before any run.

    Raises
    ------
    SceneError
    """
    if output.suffix not in ENDINGS:
        raise SceneError(f"cannot save to {output}: the ending must be one of {', '.join(ENDINGS)}")


def sweep_scenes(options: argparse.Namespace, file: Path) -> int:
    """Sweep a scene of many particles, of a fluid, or of both, and write one table.

    Raises
    ------
    SceneError
    """
    require_table(options.output)
    vary = read_varied(options.vary)
    runs = planned(read_toml(file), file.parent, runs_folder(options.output), vary)
    command = ["softdyn", "sweep", str(options.scene), *varied_options(options), "-o", str(options.output)]

    def finish() -> int:
        table = gathered(runs, vary, measured_run)
        table.save(options.output)
        tell_steadiness(runs, table) if "steady" in table.columns else tell_notes(runs, table)
        print(f"wrote {options.output}; the results are in {runs_folder(options.output)}")
        return status_of(table)

    return many_runs(options, runs, command, finish)


def particle_content(file: Path) -> tuple[Content, Path]:
    """Content of the file of a scene of many particles, and the folder that its paths are relative to.

    Raises
    ------
    SceneError
        Also if it is one of two, or of a fluid.
    """
    content = read_toml(file)
    if is_fluid_scene(content):
        raise SceneError(f"{file} is a scene of a fluid: here one of particles by themselves is needed")
    if not is_particle_scene(content):
        raise SceneError(f"{file} is a scene of two particles: here many are needed, with [particles] or [packing]")
    return content, file.parent


def require_files(options: argparse.Namespace) -> Path:
    """Refuse a table or a picture of another format before any run; returns the path of the picture.

    Raises
    ------
    SceneError
    """
    require_table(options.output)
    picture: Path = options.plot or options.output.with_suffix(".png")
    if picture.suffix not in PICTURES:
        raise SceneError(f"cannot draw to {picture}: the ending must be one of {', '.join(PICTURES)}")
    return picture


def varied_options(options: argparse.Namespace) -> list[str]:
    """The options --vary, as they were given."""
    return [part for text in options.vary for part in ("--vary", text)]


def many_runs(
    options: argparse.Namespace,
    runs: Sequence[Run],
    command: Sequence[str],
    finish: Callable[[], int],
    work: Callable[[Run], str] | None = None,
) -> int:
    """Print a script for SLURM, make one run, or make all and gather them, as the options say.

    Parameters
    ----------
    options : namespace
        Of the command line.
    runs : sequence of Run
    command : sequence of str
        Arguments that make one run, for the script.
    finish : function
        Gathers runs that are done; returns the status of the process.
    work : function of a run, optional
        Makes one, and returns why it failed, or "".

    Raises
    ------
    SceneError
    """
    if options.array:
        print(array_script(command, len(runs), f"softdyn-{options.output.stem}"), end="")
        return 0
    if options.task is not None:
        if not 0 <= options.task < len(runs):
            raise SceneError(f"--task {options.task}: there are the runs 0 to {len(runs) - 1}")
        failed = carry_out(runs, only=options.task, work=work)
        run = runs[options.task]
        print(f"{run.words}: {failed.get(options.task) or f'wrote {run.result}'}")
        return 1 if failed else 0
    if not options.gather:
        print(f"softdyn: {len(runs)} runs", file=sys.stderr)
        carry_out(runs, scheduler=options.scheduler, work=work, told=lambda *said: _tell(runs, *said))
    return finish()


def _tell(runs: Sequence[Run], number: int, done: int, count: int, failure: str) -> None:
    """Tell on stderr that a run has ended; of many, those that failed, and one in so many."""
    if not failure and done % -(-count // EACH):
        return
    words = f"failed: {failure}" if failure else "done"
    print(f"softdyn: {done} of {count}: {runs[number].words} {words}", file=sys.stderr)


def tell_failures(runs: Sequence[Run], table: RunTable | Curves) -> None:
    """Tell which runs failed, and how many are missing."""
    for number, text in [*table.failed.items()][:TOLD]:
        print(f"softdyn: {runs[number].words} failed: {text}", file=sys.stderr)
    missing = f", {len(table.missing)} not made yet" if table.missing else ""
    print(f"{len(runs)} runs, {len(table.failed)} failed{missing}")


def tell_notes(runs: Sequence[Run], table: RunTable) -> None:
    """Tell how many runs there are, and what some warn of."""
    for number, text in [*table.notes.items()][:TOLD]:
        print(f"softdyn: warning: {runs[number].words}: {text}", file=sys.stderr)
    if len(table.notes) > TOLD:
        print(f"softdyn: and {len(table.notes) - TOLD} more, see the column note", file=sys.stderr)
    tell_failures(runs, table)


def tell_steadiness(runs: Sequence[Run], table: RunTable) -> None:
    """Tell how many runs there are, and what is wrong with some."""
    for number, text in [*table.failed.items()][:TOLD]:
        print(f"softdyn: {runs[number].words} failed: {text}", file=sys.stderr)
    for number, text in [*table.notes.items()][:TOLD]:
        print(f"softdyn: {runs[number].words} is not steady: {text}", file=sys.stderr)
    hidden = max(0, len(table.failed) - TOLD) + max(0, len(table.notes) - TOLD)
    if hidden:
        print(f"softdyn: and {hidden} more, see the column note", file=sys.stderr)
    missing = f", {len(table.missing)} not made yet" if table.missing else ""
    hint = ": a longer run, [until], or more particles may tell" if table.notes else ""
    print(f"{len(runs)} runs, {len(table.failed)} failed{missing}; {len(table.notes)} of the others not steady{hint}")


def status_of(table: RunTable) -> int:
    """Exit status: 1 if a run failed, or is missing."""
    return 1 if table.failed or table.missing else 0
