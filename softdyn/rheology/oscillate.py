"""``softdyn oscillate``: oscillatory shear, small or large, over frequencies and amplitudes.

The box is sheared by strain = A sin(w t), from t = 0. Of each cycle the shear stress is projected on sin(n w t) and
cos(n w t): sigma = A sum_n (G'_n sin(n w t) + G''_n cos(n w t)), after the line from the cycle's beginning to its end
is taken off, which is what drifts. G' and G'' are those of n = 1; a harmonic's intensity is I_n = |G'_n + i G''_n|.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.results import ParticleResult
from softdyn.rheology.measures import fluid_viscosity, series
from softdyn.rheology.options import runs_folder
from softdyn.rheology.run_table import RunTable, gathered
from softdyn.rheology.runs import Content, Run, planned
from softdyn.rheology.sweep_command import (
    many_runs,
    particle_content,
    require_files,
    status_of,
    tell_failures,
    varied_options,
)
from softdyn.scene.numbers import SMALLEST_RTOL
from softdyn.scene.stock_scenes import found_scene
from softdyn.scene.varied_content import with_values
from softdyn.varied import read_named, read_varied

Array = NDArray[np.float64]

FREQUENCY, AMPLITUDE = "frequency", "amplitude"
#: Names of the constants in the scene's expression.
W, A = "oscillation_frequency", "oscillation_amplitude"
#: Outputs of a cycle, and the highest harmonic that is told of them.
POINTS, HARMONICS = 64, 9
#: Error of the gaps in a step, over the strain.
FINE = 0.01
#: G* may change by this part of itself over the cycles that are taken, where they are called steady.
STEADY = 0.02


def oscillating_scene(content: Content, values: Mapping[str, float], cycles: int) -> Content:
    """Scene of one run: a strain A sin(w t), for so many cycles.

    Parameters
    ----------
    content : mapping
        The scene as read from TOML.
    values : mapping from str to float
        Frequency, in radians/time, amplitude of the strain, and what else is varied.
    cycles : int

    Raises
    ------
    SceneError
        If the scene imposes a stress, or names constants as this does.
    """
    frequency, amplitude = values[FREQUENCY], values[AMPLITUDE]
    rest = {name: value for name, value in values.items() if name not in (FREQUENCY, AMPLITUDE)}
    made = with_values(ParticleScene, content, rest)
    if "xy" in made.get("stress", {}):
        raise SceneError("oscillate imposes a strain: leave [stress] xy out")
    constants = made.setdefault("constants", {})
    if {W, A} & set(constants):
        raise SceneError(f"[constants] {W} and {A} are names that oscillate gives: choose others")
    constants |= {W: frequency, A: amplitude}
    made.setdefault("flow", {})["shear_rate"] = f"{A}*{W}*cos({W}*t)"
    made["until"] = {"t": cycles * 2 * math.pi / frequency}
    made.setdefault("output", {})["times"] = cycles * POINTS + 1
    resolve(made, amplitude)
    return made


def resolve(made: Content, strain: float) -> None:
    """Ask for steps that resolve what a strain changes: the error of a gap below a hundredth of the strain.

    Gaps are smaller than radii, so that a strain changes each by more than this part of itself.
    """
    accuracy = made.setdefault("accuracy", {})
    given = accuracy.get("rtol", 1e-4)
    if isinstance(given, (int, float)):
        accuracy["rtol"] = max(min(float(given), FINE * abs(strain)), 100 * SMALLEST_RTOL)


def harmonics(stress: Array, amplitude: float) -> NDArray[np.complex128]:
    """Moduli G'_n + i G''_n of each cycle, n from 1 to HARMONICS.

    Parameters
    ----------
    stress : array, shape (cycles * POINTS + 1,)
        At equal times, from the beginning of the first cycle to the end of the last.
    amplitude : float
        Of the strain, amplitude * sin(w t).

    Returns
    -------
    array of complex, shape (cycles, HARMONICS)
    """
    cycles = (len(stress) - 1) // POINTS
    phase = 2 * np.pi * np.arange(POINTS) / POINTS
    # sin -> real part, cos -> imaginary part
    waves = np.exp(-1j * np.outer(np.arange(1, HARMONICS + 1), phase)) * 1j
    found = np.empty((cycles, HARMONICS), dtype=complex)
    for cycle in range(cycles):
        part = stress[cycle * POINTS : (cycle + 1) * POINTS + 1]
        line = np.linspace(part[0], part[-1], POINTS + 1)
        found[cycle] = waves @ (part - line)[:-1] * (2 / POINTS) / amplitude
    return found


def measured_oscillation(result: ParticleResult, run: Run) -> tuple[dict[str, float], str]:
    """Moduli of a run with their errors, from the second half of its cycles, and a note where these are not steady."""
    found = series(result)
    if "contact_stress" not in found:
        raise SceneError("oscillate needs a box that is periodic along all axes, in two dimensions or three")
    amplitude, w = run.values[AMPLITUDE], run.values[FREQUENCY]
    moduli = harmonics(found["contact_stress"], amplitude)
    used = moduli[len(moduli) // 2 :]
    first = used[:, 0]
    mean = used.mean(axis=0)
    eta = fluid_viscosity(result) or 0.0
    whole = mean[0] + 1j * eta * w
    deviation = np.array([np.std(part, ddof=1) for part in (first.real, first.imag)]) / math.sqrt(len(first))
    size = abs(whole)
    change = float(abs(first[-1] - first[0]) / size) if size else math.nan
    row = {
        "G_storage": whole.real,
        "G_storage_error": float(deviation[0]),
        "G_loss": whole.imag,
        "G_loss_error": float(deviation[1]),
        "G_loss_contacts": float(mean[0].imag),
        "G_loss_fluid": eta * w,
        "tan_delta": whole.imag / whole.real if whole.real else math.nan,
        "change": change,
        "steady": float(change <= STEADY),
    }
    row |= {f"I{n}_I1": float(abs(mean[n - 1]) / size) if size else math.nan for n in range(2, HARMONICS + 1)}
    row |= {"pressure": float(found["pressure"][len(found["pressure"]) // 2 :].mean())}
    note = f"G* still changes by {100 * change:.2g} % over the cycles taken" if change > STEADY else ""
    return row, note


def loop_of(result: ParticleResult, run: Run) -> tuple[Array, Array, Array]:
    """Strain, shear stress (of contacts and fluid), and strain rate of the last cycle."""
    found = series(result)
    last = slice(-POINTS - 1, None)
    phase = run.values[FREQUENCY] * result.t[last]
    amplitude = run.values[AMPLITUDE]
    return amplitude * np.sin(phase), found["shear_stress"][last], amplitude * run.values[FREQUENCY] * np.cos(phase)


def oscillate(options: argparse.Namespace) -> int:
    """Carry out the command.

    Raises
    ------
    SceneError
    """
    picture = require_files(options)
    if not 4 <= options.cycles <= 1000:
        raise SceneError(f"--cycles {options.cycles}: 4 to 1000, of which the second half is taken")
    content, home = particle_content(found_scene(options.scene))
    vary = {
        FREQUENCY: read_named("--frequency", options.frequency),
        AMPLITUDE: read_named("--amplitude", options.amplitude),
    }
    for name, values in vary.items():
        if not (values > 0).all():
            raise SceneError(f"--{name}: all values must be positive")
    vary |= read_varied(options.vary)
    runs = planned(
        content,
        home,
        runs_folder(options.output),
        vary,
        lambda given, values: oscillating_scene(given, values, options.cycles),
    )
    command = ["softdyn", "oscillate", str(options.scene), "--frequency", options.frequency]
    command += ["--amplitude", options.amplitude, "--cycles", str(options.cycles), *varied_options(options)]
    command += ["-o", str(options.output), "--plot", str(picture)]

    def finish() -> int:
        loops: dict[int, tuple[Array, Array, Array]] = {}

        def measured(result: ParticleResult, run: Run) -> tuple[dict[str, float], str]:
            loops[run.number] = loop_of(result, run)
            return measured_oscillation(result, run)

        table = gathered(runs, vary, measured)
        table.save(options.output)
        tell_failures(runs, table)
        _tell(table)
        written = str(options.output)
        if loops:
            from softdyn.rheology.rheology_plots import draw_oscillations, save_figure

            save_figure(draw_oscillations(table, loops), picture, table.units)
            written += f" and {picture}"
        print(f"wrote {written}; the results are in {runs_folder(options.output)}")
        return status_of(table)

    return many_runs(options, runs, command, finish)


def _tell(table: RunTable) -> None:
    """Print the moduli of each run."""
    if "G_storage" not in table.columns:
        return
    c = table.columns
    print("  ".join([*(f"{name:>12}" for name in table.varied), f"{'G-storage':>20}  {'G-loss':>20}  {'I3/I1':>8}"]))
    for run in range(len(table)):
        if np.isnan(c["G_storage"][run]):
            continue
        shown = [f"{values[run]:12.4g}" for values in table.varied.values()]
        shown += [f"{c[name][run]:.4g} +- {c[f'{name}_error'][run]:.1g}".rjust(20) for name in ("G_storage", "G_loss")]
        shown += [f"{c['I3_I1'][run]:8.2g}", "" if c["steady"][run] else table.notes[run]]
        print("  ".join(shown).rstrip())
