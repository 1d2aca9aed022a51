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

A scene of many particles, of a fluid, or of grains in one: any number of the scene, by its key, as packing.fraction,
until.strain, shear_rate or fluid.viscosity (softdyn keys lists them). The result of each run is a file in FILE.runs/
(without FILE's ending); the table has a row for each run. Of particles: whether it was steady, and since when, means
with errors, and last values. Of a fluid: forces, fluxes, powers and imbalances; of flows that are not steady the means
over the second half of the time, the least and largest values of that half, and the last ones. A run that fails is
named, and the others go on. Killed, the same command goes on from there.

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
    """Options of commands that make many runs: a scene, what is varied, and how they are made."""
    _add_scene(parser)
    parser.add_argument(
        "--vary",
        metavar="NAME=VALUES",
        action="append",
        required=required,
        default=[] if not required else None,
        help="logspace(a,b,n), linspace(a,b,n), first..last (whole numbers) or x,y,...; repeatable, for every "
        "combination",
    )
    if required:
        _add_making(parser, "not of two particles: ", "but of two particles, .nc (netCDF)")
    else:
        _add_making(parser, "", ".nc (netCDF)")


def _add_scene(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "scene", metavar="SCENE", type=Path, help="a .toml file, or a scene that comes with softdyn, by name"
    )


def _add_making(parser: argparse.ArgumentParser, whose: str, last: str) -> None:
    """Where the table goes, and who makes the runs; ``whose`` runs may be an array job, ``last``: a format."""
    parser.add_argument(
        "-o", dest="output", metavar="FILE", type=Path, required=True, help=f"one table: .csv, .npz, or {last}"
    )
    parser.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster (default: this machine's own processors)"
    )
    array = parser.add_mutually_exclusive_group()
    array.add_argument("--array", action="store_true", help=f"{whose}run nothing, print a script for SLURM")
    array.add_argument("--task", metavar="N", type=int, help=f"{whose}make run N alone, from 0 on")
    array.add_argument("--gather", action="store_true", help=f"{whose}make nothing, gather what is there")


def carried_out_by(name: str) -> Callable[[Any], int]:
    """The function of a module of this room, "module:function", imported when the command is given."""

    def command(options: Any) -> int:
        from importlib import import_module

        module, _, function = name.partition(":")
        found: Callable[[Any], int] = getattr(import_module(f"softdyn.rheology.{module}"), function)
        return found(options)

    return command


FLOW = """

Each rate is run to the strain at which the scene ends, [until] strain, with 201 outputs at least. From when on a run
is steady is found by the marginal standard error rule, and by comparing the halves of what it leaves; means have error
bars by blocking. What never becomes steady is said so, drawn open, and enters no fit. Herschel & Bulkley's law and a
power law are fitted to what contacts and fluid bear together, with standard errors; where the data do not determine a
parameter, that is said. Runs that differ in packing.seed alone are points of one curve.

FILE has a row for each run; FILE.fits.csv one for each parameter of each fit. Shear stress, pressure and normal stress
differences are drawn.

examples:
  softdyn flow-curve emulsion --rates 'logspace(-5,-3,5)' -o curve.csv
  softdyn flow-curve emulsion --rates 'logspace(-5,-3,5)' --vary packing.fraction=0.8,0.85,0.9 \\
                              --vary packing.seed=1..3 -o curve.csv --array > job.sh && sbatch job.sh
"""

OSCILLATION = """

The box is sheared by strain = A sin(w t); w is an angular frequency, as rheometers give it. Of each of the cycles the
stress is projected on sin(n w t) and cos(n w t), n = 1 to 9; the second half of the cycles is taken, with errors from
their scatter, and it is said where G* still changes by more than 2 % over them. G'' has the fluid's eta w in it; the
table has its parts, and the intensities of the harmonics, I3_I1 and so on. Steps are made with [accuracy] rtol, or a
hundredth of the amplitude, if that is less.

examples:
  softdyn oscillate emulsion --frequency 'logspace(-4,-1,4)' --amplitude 0.01 -o frequencies.csv
  softdyn oscillate emulsion --frequency 1e-3 --amplitude 'logspace(-3,0,7)' --vary packing.count=100 -o amplitudes.csv
"""

STEP = """

A step of strain: the box is at rest, is sheared by the strain at a constant rate within the ramp, and rests again:
G(t) = (stress - stress before)/strain; [accuracy] rtol is a hundredth of the strain at most. A step of stress: the box
is free to shear under it, J(t) = strain/stress, and
recovers when it is taken off. What the scene says of shear rate, end and outputs is left aside.

examples:
  softdyn step emulsion --strain 0.01,0.1 --time 1e4 --rest 1e4 -o relaxation.csv
  softdyn step emulsion --stress 0.01 --time 1e4 --recovery 1e4 --vary packing.count=100 -o creep.csv
"""


COMPRESSION = """

The box is deformed in affine steps, with all particles and with the films as they are, and rests after each until the
stress has settled: until it changes by less than 1 % of the pressure while all of the rest is doubled. Fractions are
gone through in the order in which they are given, up and down; then, at the last, shear strains. What has not settled
after 12 doublings is said so. At each fraction two small shears, one each way, from which nothing goes on, probe the
shear modulus, after as long a rest; fraction dp/dfraction is the bulk modulus. Where the pressure sets in is told:
between which states, and where it extrapolates to 0. What the scene says of shear rate, end and outputs is left aside.

examples:
  softdyn compress emulsion --fractions 'linspace(0.8,0.95,16)' --rest 100 --vary packing.fraction=0.78 \\
                            --vary packing.seed=1..5 -o jamming.csv
  softdyn compress emulsion --fractions 0.9 --strains 'linspace(0.005,0.2,40)' --rest 100 -o yielding.csv
"""


UNCERTAINTY = """

Parameters that are known as distributions only: the scene is run at N quasi-random samples (scrambled points of Sobol's
sequence), and of each number that a run measures FILE.quantiles.csv tells mean, deviation and quantiles. Parameters are
independent. With --sobol N (parameters + 2) runs are made, and FILE.sobol.csv tells by which parameter each number
varies: first-order and total indices of Sobol, with intervals of 95 %. Scenes of two particles, of many, of a fluid and
of grains in one; results, failures and resuming as of softdyn sweep.

DISTRIBUTION is one of
  normal(mean, standard deviation)      lognormal(median, factor), 68 % within median/factor and median*factor
  uniform(least, largest)               loguniform(least, largest)
  triangular(least, likeliest, largest) integers(least, largest), as of packing.seed

examples:
  softdyn uncertainty emulsion --given 'sigma=lognormal(1,1.1)' --given 'packing.seed=integers(1,1000)' --samples 32 \\
                               -o emulsion.csv
  softdyn uncertainty darcy --given 'bed.radius=normal(2e-4,1e-5)' --given 'fluid.viscosity=uniform(8e-4,1.2e-3)' \\
                            --samples 64 --sobol --observe flux_right -o darcy.csv
"""


def _add_uncertainty(add: Add) -> None:
    parser = add(
        "uncertainty",
        carried_out_by("uncertainty:uncertainty"),
        "what a scene gives if parameters are known as distributions only",
        UNCERTAINTY,
    )
    _add_scene(parser)
    parser.add_argument(
        "--given", metavar="NAME=DISTRIBUTION", action="append", required=True, help="repeatable, see above"
    )
    parser.add_argument("--samples", metavar="N", type=int, default=64, help="a power of two; default: %(default)s")
    parser.add_argument("--sobol", action="store_true", help="find indices of Sobol, too, by more runs")
    parser.add_argument("--seed", metavar="N", type=int, default=1, help="of the samples; default: %(default)s")
    parser.add_argument("--observe", metavar="NAMES", help="columns to print and draw; default: the first that vary")
    _add_making(parser, "", ".nc (netCDF)")
    _add_plot(parser)


def _add_compress(add: Add) -> None:
    parser = add(
        "compress", carried_out_by("compress:compress"), "quasi-static compression and shear: jamming", COMPRESSION
    )
    add_sweep_options(parser, required=False)
    parser.add_argument("--fractions", metavar="VALUES", required=True, help="in their order, as the VALUES of --vary")
    parser.add_argument("--strains", metavar="VALUES", help="of shear, at the last fraction, likewise (default: none)")
    parser.add_argument("--rest", metavar="T", type=float, required=True, help="time of the first rest after a step")
    parser.add_argument(
        "--probe", metavar="STRAIN", type=float, default=1e-3, help="of the modulus, 0 for none; default: %(default)s"
    )
    _add_plot(parser)


def _add_flow_curve(add: Add) -> None:
    parser = add(
        "flow-curve",
        carried_out_by("flow_curve:flow_curve"),
        "steady shear at many rates: stress, fits, a picture",
        FLOW,
    )
    add_sweep_options(parser, required=False)
    parser.add_argument("--rates", metavar="VALUES", required=True, help="shear rates, as the VALUES of --vary")
    _add_plot(parser)


def _add_oscillate(add: Add) -> None:
    parser = add(
        "oscillate", carried_out_by("oscillate:oscillate"), "oscillatory shear: G', G'', harmonics", OSCILLATION
    )
    add_sweep_options(parser, required=False)
    parser.add_argument("--frequency", metavar="VALUES", required=True, help="angular, as the VALUES of --vary")
    parser.add_argument("--amplitude", metavar="VALUES", required=True, help="of the strain, likewise")
    parser.add_argument("--cycles", metavar="N", type=int, default=6, help="4 at least; default: %(default)s")
    _add_plot(parser)


def _add_step(add: Add) -> None:
    parser = add(
        "step", carried_out_by("step_test:step"), "stress relaxation after a step strain; creep, recovery", STEP
    )
    add_sweep_options(parser, required=False)
    parser.add_argument("--strain", metavar="VALUES", help="steps of strain, as the VALUES of --vary")
    parser.add_argument("--stress", metavar="VALUES", help="steps of shear stress, likewise")
    parser.add_argument("--time", metavar="T", type=float, required=True, help="how long what follows is observed")
    parser.add_argument("--rest", metavar="T", type=float, default=0.0, help="before the step (default: none)")
    parser.add_argument("--ramp", metavar="T", type=float, help="of a step of strain; default: a thousandth of --time")
    parser.add_argument(
        "--recovery", metavar="T", type=float, default=0.0, help="after a step of stress is taken off (default: none)"
    )
    _add_plot(parser)


def _add_plot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--plot", metavar="PICTURE", type=Path, help=".png, .svg or .pdf; default: FILE with .png")


#: Each adds a command.
VERBS: tuple[Callable[[Add], None], ...] = (_add_flow_curve, _add_oscillate, _add_step, _add_compress, _add_uncertainty)
