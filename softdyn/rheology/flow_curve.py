"""``softdyn flow-curve``: steady shear at many rates, with error bars, fits, a picture and a table."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.particle_keys import ParticleScene
from softdyn.results.whole_files import written_whole
from softdyn.rheology.flow_laws import FLOW_LAWS, FlowFit, fit_flow_law
from softdyn.rheology.options import runs_folder
from softdyn.rheology.run_table import RunTable, gathered, measured_run
from softdyn.rheology.runs import Content, planned
from softdyn.rheology.sweep_command import (
    many_runs,
    particle_content,
    require_files,
    status_of,
    tell_steadiness,
    varied_options,
)
from softdyn.scene.stock_scenes import found_scene
from softdyn.scene.varied_content import places, with_values
from softdyn.varied import read_named, read_varied

Array = NDArray[np.float64]

#: Name of the rate, and of what makes another realisation of the same.
RATE, SEED = "flow.shear_rate", "packing.seed"
#: Output times of a run, at least: what means and their errors are taken of.
OUTPUTS = 201


@dataclass(frozen=True)
class FlowCurve:
    """The flow curve at one set of what else was varied.

    Attributes
    ----------
    given : mapping from str to float
        That set.
    runs : array of int
        Numbers of its runs, rows of the table.
    fits : tuple of FlowFit
    why : mapping from str to str
        Why there is no fit of a law.
    """

    given: Mapping[str, float]
    runs: NDArray[np.int64]
    fits: tuple[FlowFit, ...]
    why: Mapping[str, str]

    @property
    def words(self) -> str:
        """What it is the curve of."""
        return ", ".join(f"{name} = {value:g}" for name, value in self.given.items())


def flow_scene(content: Content, values: Mapping[str, float]) -> Content:
    """Scene of one run: the rate and what else is varied in their places, and outputs enough to take means of.

    Raises
    ------
    SceneError
        If the scene has no strain at which it ends, or an imposed shear stress.
    """
    made = with_values(ParticleScene, content, values)
    if "xy" in made.get("stress", {}):
        raise SceneError("flow-curve imposes shear rates: leave [stress] xy out")
    if "strain" not in made.get("until", {}):
        raise SceneError("flow-curve runs each rate to one strain: give [until] strain, or --vary until.strain=2")
    output = made.setdefault("output", {})
    times = output.get("times", 0)
    if not isinstance(times, int):
        raise SceneError("flow-curve takes means over evenly spaced times: give [output] times as a count")
    output["times"] = max(times, OUTPUTS)
    return made


def flow_curves(table: RunTable) -> list[FlowCurve]:
    """Flow curves of a table, one for each set of what was varied but for the rate and the seed, with fits.

    Only steady runs are fitted; those of several seeds are points of one curve.
    """
    others = [name for name in table.varied if name not in (RATE, SEED)]
    sets = np.column_stack([table.varied[name] for name in others] or [np.zeros(len(table))])
    found = []
    for one in np.unique(sets, axis=0):
        runs = np.flatnonzero((sets == one).all(axis=1))
        given = {name: float(value) for name, value in zip(others, one, strict=False)}
        fits, why = _fits(table, runs)
        found.append(FlowCurve(given, runs, fits, why))
    return found


def _fits(table: RunTable, runs: NDArray[np.int64]) -> tuple[tuple[FlowFit, ...], dict[str, str]]:
    columns = table.columns
    if "shear_stress_error" not in columns:
        return (), dict.fromkeys(FLOW_LAWS, "no run has ended")
    good = runs[(columns["steady"][runs] == 1) & (columns["shear_stress_error"][runs] > 0)]
    rates, stress, errors = table.varied[RATE][good], columns["shear_stress"][good], columns["shear_stress_error"][good]
    fits, why = [], {}
    for law in FLOW_LAWS:
        try:
            fits.append(fit_flow_law(law, rates, stress, errors))
        except SceneError as error:
            why[law] = f"{error} (steady runs alone count)"
    return tuple(fits), why


def flow_curve(options: argparse.Namespace) -> int:
    """Carry out the command.

    Raises
    ------
    SceneError
    """
    picture = require_files(options)
    content, home = particle_content(found_scene(options.scene))
    vary = {_full(name, content): values for name, values in read_varied(options.vary).items()}
    if RATE in vary:
        raise SceneError("the rates are given by --rates, not by --vary")
    rates = read_named("--rates", options.rates)
    if not (rates > 0).all():
        raise SceneError(f"--rates {options.rates}: rates must be positive")
    vary = {RATE: rates, **vary}
    runs = planned(content, home, runs_folder(options.output), vary, flow_scene)
    command = ["softdyn", "flow-curve", str(options.scene), "--rates", options.rates, *varied_options(options)]
    command += ["-o", str(options.output), "--plot", str(picture)]

    def finish() -> int:
        table = gathered(runs, vary, measured_run)
        table.save(options.output)
        curves = flow_curves(table)
        fits = options.output.with_name(f"{options.output.stem}.fits.csv")
        _save_fits(curves, fits)
        tell_steadiness(runs, table)
        _tell(table, curves)
        written = f"{options.output} and {fits}"
        if (table.columns.get("steady", np.zeros(0)) >= 0).any():
            from softdyn.rheology.rheology_plots import draw_flow_curves, save_figure

            save_figure(draw_flow_curves(table, curves), picture, table.units)
            written += f" and {picture}"
        print(f"wrote {written}; the results are in {runs_folder(options.output)}")
        return status_of(table)

    return many_runs(options, runs, command, finish)


def _full(name: str, content: Content) -> str:
    """The full name of what is varied, as far as it is known: section.key."""
    there = places(ParticleScene, content).get(name, [])
    return f"{there[0].section}.{there[0].name}" if len(there) == 1 else name


def _tell(table: RunTable, curves: Sequence[FlowCurve]) -> None:
    """Print what is measured, a line a run, and the fits."""
    columns = table.columns
    if "steady" not in columns:
        return
    for curve in curves:
        print(f"{curve.words or 'flow curve'}:")
        print("  shear rate   shear stress           contacts   fluid      pressure               N1")
        for run in curve.runs:
            if not np.isfinite(columns["steady"][run]):
                continue
            shown = [f"  {table.varied[RATE][run]:<12.4g}"]
            shown += [_with_error(columns, "shear_stress", run), f"{columns['contact_stress'][run]:<10.3g} "]
            shown += [f"{columns['fluid_stress'][run]:<10.3g} "] if "fluid_stress" in columns else [" " * 11]
            shown += [_with_error(columns, "pressure", run), _with_error(columns, "N1", run)]
            steady = "" if columns["steady"][run] else "not steady: means of its last half"
            print(" ".join([*shown, steady]).rstrip())
        for fit in curve.fits:
            print(f"  {fit.words()}")
        for text in dict.fromkeys(curve.why.values()):
            print(f"  no fit: {text}")


def _with_error(columns: Mapping[str, Array], name: str, run: int) -> str:
    error = columns[f"{name}_error"][run]
    return f"{columns[name][run]:.4g}{f' +- {error:.2g}' if np.isfinite(error) else ''}".ljust(22)


def _save_fits(curves: Sequence[FlowCurve], path: Path) -> None:
    """Write a line for each parameter of each fit."""
    names = list(dict.fromkeys(name for curve in curves for name in curve.given))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*names, "law", "parameter", "value", "error", "chi2", "dof", "note"])
    for curve in curves:
        given: list[Any] = [curve.given[name] for name in names]
        for fit in curve.fits:
            for name, value in fit.values.items():
                note = fit.undetermined.get(name, "")
                writer.writerow([*given, fit.law, name, value, fit.errors[name], fit.chi2, fit.dof, note])
        for law, why in curve.why.items():
            writer.writerow([*given, law, "", "", "", "", "", why])
    with written_whole(path) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")
