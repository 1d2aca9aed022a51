"""The commands of this room, as the command line offers them; what carries them out is imported when asked for."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: Adds a command: its name, what carries it out, a line of help, and more of it.
Add = Callable[..., argparse.ArgumentParser]

SWEPT = """

A scene of two particles: a parameter of the law, a constant of the drive, h, delta, force, velocity or kappa is varied,
and the table has the outputs of all runs.

A scene of many particles: any number of the scene, by its key, as packing.fraction, until.strain or shear_rate (softdyn
keys lists them). The result of each run is a file in FILE.runs/ (without FILE's ending); the table has a row for each
run: whether it was steady, and since when, means with errors, and last values. A run that fails is named, and the
others go on. Killed, the same command goes on from there.

examples:
  softdyn sweep scene.toml --vary 'kappa=logspace(-6,-0.5,100)' -o table.csv
  softdyn sweep emulsion --vary 'shear_rate=logspace(-5,-3,5)' --vary packing.fraction=0.8,0.85,0.9 \\
                         --vary packing.seed=1..5 -o emulsion.csv
  softdyn sweep emulsion --vary packing.seed=1..100 -o emulsion.csv --array > job.sh && sbatch job.sh
  softdyn sweep emulsion --vary packing.seed=1..100 -o emulsion.csv --gather     when the tasks have ended
"""


def runs_folder(output: Path) -> Path:
    """Folder of the results of many runs."""
    return output.with_suffix(".runs")


def add_sweep_options(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Options of commands that make many runs."""
    parser.add_argument(
        "scene",
        metavar="SCENE",
        type=Path,
        help="a .toml file, or a scene of many particles that comes with softdyn, by name",
    )
    parser.add_argument(
        "--vary",
        metavar="NAME=VALUES",
        action="append",
        required=required,
        default=[] if not required else None,
        help="logspace(a,b,n), linspace(a,b,n), first..last (whole numbers) or x,y,...; repeatable, for every "
        "combination",
    )
    parser.add_argument(
        "-o", dest="output", metavar="FILE", type=Path, required=True,
        help="one table: .csv, .npz, or, of many particles, .nc (netCDF)",
    )  # fmt: skip
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster (default: this machine's own processors)"
    )
    array = parser.add_mutually_exclusive_group()
    array.add_argument("--array", action="store_true", help="many particles: run nothing, print a script for SLURM")
    array.add_argument("--task", metavar="N", type=int, help="many particles: make run N alone, from 0 on")
    array.add_argument("--gather", action="store_true", help="many particles: make nothing, gather what is there")


#: Each adds a command.
VERBS: tuple[Callable[[Add], None], ...] = ()


def carried_out_by(name: str) -> Callable[[Any], int]:
    """The function of a module of this room, "module:function", imported when the command is given."""

    def command(options: Any) -> int:
        from importlib import import_module

        module, _, function = name.partition(":")
        found: Callable[[Any], int] = getattr(import_module(f"softdyn.rheology.{module}"), function)
        return found(options)

    return command
