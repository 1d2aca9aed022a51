"""``softdyn step``: stress relaxation after a step of strain; creep under a step of stress, and recovery after it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.results import ParticleResult
from softdyn.rheology.curves import Curves, gathered_curves
from softdyn.rheology.measures import series, sheared_by
from softdyn.rheology.options import runs_folder
from softdyn.rheology.oscillate import resolve
from softdyn.rheology.runs import Content, Run, planned
from softdyn.rheology.sweep_command import (
    many_runs,
    particle_content,
    require_files,
    tell_failures,
    varied_options,
)
from softdyn.scene.stock_scenes import found_scene
from softdyn.scene.varied_content import with_values
from softdyn.varied import read_named, read_varied

Array = NDArray[np.float64]

STRAIN, STRESS = "strain", "stress"
SIZE, START, SPAN = "step_size", "step_start", "step_span"
#: Output times after a step, evenly spaced in their logarithm; the shortest is this part of the time.
OUTPUTS, SHORTEST = 61, 1e-4


def spread(start: float, time: float, shortest: float) -> list[float]:
    """Times after a start, evenly spaced in their logarithm.

    Parameters
    ----------
    start : float
        A time.
    time : float
        From there to the last.
    shortest : float
        From there to the first.
    """
    times: list[float] = (start + np.geomspace(shortest, time, OUTPUTS)).tolist()
    return times


def relaxation_scene(content: Content, values: Mapping[str, float], time: float, rest: float, ramp: float) -> Content:
    """Scene of a step of strain: at rest, a ramp at a constant rate, and at rest again.

    Parameters
    ----------
    content : mapping
        The scene as read from TOML.
    values : mapping from str to float
        The strain of the step, and what else is varied.
    time : float
        After the ramp.
    rest : float
        Time before it.
    ramp : float
        Time that it takes.

    Raises
    ------
    SceneError
    """
    made = _bare(content, {name: value for name, value in values.items() if name != STRAIN})
    if "xy" in made.get("stress", {}):
        raise SceneError("a step of strain and [stress] xy: give one of them")
    made.setdefault("constants", {}).update({SIZE: values[STRAIN], SPAN: ramp} | ({START: rest} if rest else {}))
    on = f"step(t - {START})" if rest else "1"
    off = f"step(t - {START} - {SPAN})" if rest else f"step(t - {SPAN})"
    made.setdefault("flow", {})["shear_rate"] = f"{SIZE}/{SPAN}*({on} - {off})"
    made["until"] = {"t": rest + ramp + time}
    before = np.linspace(0.0, rest, 6)[:-1].tolist() if rest else []
    after = spread(rest + ramp, time, time * SHORTEST)
    made.setdefault("output", {})["times"] = [*before, rest, rest + ramp, *after[:-1], rest + ramp + time]
    resolve(made, values[STRAIN])
    return made


def creep_scene(content: Content, values: Mapping[str, float], time: float, rest: float, recovery: float) -> Content:
    """Scene of a step of shear stress, which is taken off again where there is a time of recovery.

    Parameters
    ----------
    content : mapping
        The scene as read from TOML.
    values : mapping from str to float
        The shear stress, and what else is varied.
    time : float
        For which it is on.
    rest : float
        Time before it.
    recovery : float
        Time after it; 0 if there is none.
    """
    made = _bare(content, {name: value for name, value in values.items() if name != STRESS})
    made.get("flow", {}).pop("shear_rate", None)
    constants = {SIZE: values[STRESS]} | ({START: rest} if rest else {}) | ({SPAN: rest + time} if recovery else {})
    made.setdefault("constants", {}).update(constants)
    on = f"step(t - {START})" if rest else "1"
    off = f" - step(t - {SPAN})" if recovery else ""
    made.setdefault("stress", {})["xy"] = f"{SIZE}*({on}{off})"
    end = rest + time + recovery
    made["until"] = {"t": end}
    before = np.linspace(0.0, rest, 6)[:-1].tolist() if rest else []
    times = [*before, rest, *spread(rest, time, time * SHORTEST)[:-1], rest + time]
    if recovery:
        times += [*spread(rest + time, recovery, recovery * SHORTEST)[:-1], end]
    made.setdefault("output", {})["times"] = times
    return made


def _bare(content: Content, values: Mapping[str, float]) -> Content:
    made = with_values(ParticleScene, content, values)
    if {SIZE, START, SPAN} & set(made.get("constants", {})):
        raise SceneError(f"[constants] {SIZE}, {START} and {SPAN} are names that step gives: choose others")
    return made


def relaxation_of(result: ParticleResult, run: Run, rest: float, ramp: float) -> dict[str, Array]:
    """Time since the end of the ramp, strain, shear stress, and the relaxation modulus G(t).

    G is the shear stress of the contacts, less that before the step, over the strain of the step: after the ramp
    nothing shears, and the fluid bears none.

    Parameters
    ----------
    result : ParticleResult
    run : Run
    rest : float
        Time before the ramp.
    ramp : float
        Time that it takes.
    """
    found = _stress(result)
    begin = int(np.searchsorted(result.t, rest * (1 - 1e-12)))
    after = slice(begin + 1, None)
    modulus = (found["contact_stress"][after] - found["contact_stress"][begin]) / run.values[STRAIN]
    return {
        "time": result.t[after] - (rest + ramp),
        "strain": sheared_by(result)[after] - sheared_by(result)[begin],
        "shear_stress": found["shear_stress"][after],
        "pressure": found["pressure"][after],
        "G": modulus,
    }


def creep_of(result: ParticleResult, run: Run, rest: float) -> dict[str, Array]:
    """Time since the step, strain, shear rate, and the compliance: strain over stress.

    Parameters
    ----------
    result : ParticleResult
    run : Run
    rest : float
        Time before the step.
    """
    begin = int(np.searchsorted(result.t, rest * (1 - 1e-12)))
    after = slice(begin, None)
    strain = sheared_by(result)[after] - sheared_by(result)[begin]
    found = _stress(result)
    return {
        "time": result.t[after] - rest,
        "strain": strain,
        "shear_rate": result.gradient[after, 0, 1],
        "shear_stress": found["shear_stress"][after],
        "J": strain / run.values[STRESS],
    }


def _stress(result: ParticleResult) -> dict[str, Array]:
    found = series(result)
    if "shear_stress" not in found:
        raise SceneError("step needs a box that is periodic along all axes, in two dimensions or three")
    return found


def step(options: argparse.Namespace) -> int:
    """Carry out the command.

    Raises
    ------
    SceneError
    """
    picture = require_files(options)
    if (options.strain is None) == (options.stress is None):
        raise SceneError("step takes --strain, for the relaxation of stress, or --stress, for creep: one of them")
    creeps = options.stress is not None
    if creeps and options.ramp is not None:
        raise SceneError("--ramp is of a step of strain")
    if not creeps and options.recovery:
        raise SceneError("--recovery is of creep, with --stress")
    times = {"--time": options.time, "--rest": options.rest, "--recovery": options.recovery}
    ramp = options.time / 1000 if options.ramp is None else options.ramp
    for name, value in {**times, "--ramp": ramp}.items():
        if not (np.isfinite(value) and (value > 0 or (value == 0 and name in ("--rest", "--recovery")))):
            raise SceneError(f"{name} {value:g}: a positive time is needed")
    content, home = particle_content(found_scene(options.scene))
    name, given = (STRESS, options.stress) if creeps else (STRAIN, options.strain)
    sizes = read_named(f"--{name}", given)
    if not (np.isfinite(sizes) & (sizes != 0)).all():
        raise SceneError(f"--{name} {given}: a step is a number other than 0")
    vary = {name: sizes, **read_varied(options.vary)}

    def build(content: Content, values: Mapping[str, float]) -> Content:
        if creeps:
            return creep_scene(content, values, options.time, options.rest, options.recovery)
        return relaxation_scene(content, values, options.time, options.rest, ramp)

    def measured(result: ParticleResult, run: Run) -> dict[str, Array]:
        return creep_of(result, run, options.rest) if creeps else relaxation_of(result, run, options.rest, ramp)

    runs = planned(content, home, runs_folder(options.output), vary, build)
    command = ["softdyn", "step", str(options.scene), f"--{name}={given}", "--time", repr(options.time)]
    command += [
        "--rest",
        repr(options.rest),
        *(["--recovery", repr(options.recovery)] if creeps else ["--ramp", repr(ramp)]),
    ]
    command += [*varied_options(options), "-o", str(options.output), "--plot", str(picture)]

    def finish() -> int:
        curves = gathered_curves(runs, vary, measured)
        curves.save(options.output)
        tell_failures(runs, curves)
        _tell(curves, creeps, options.time)
        written = str(options.output)
        if curves.curves:
            from softdyn.rheology.rheology_plots import draw_steps, save_figure

            save_figure(draw_steps(curves, creeps, options.time), picture, curves.units)
            written += f" and {picture}"
        print(f"wrote {written}; the results are in {runs_folder(options.output)}")
        return 1 if curves.failed or curves.missing else 0

    return many_runs(options, runs, command, finish)


def _tell(curves: Curves, creeps: bool, time: float) -> None:
    """Print where each curve ends."""
    for number, curve in curves.curves.items():
        if not creeps:
            print(f"{curves.words(number)}: G = {curve['G'][0]:.4g} after the ramp, {curve['G'][-1]:.4g} at the end")
            continue
        end = int(np.searchsorted(curve["time"], time * (1 - 1e-12)))
        text = f"strain {curve['strain'][end]:.4g} under the stress, J = {curve['J'][end]:.4g}"
        if len(curve["time"]) > end + 1:
            recovered = curve["strain"][end] - curve["strain"][-1]
            text += f"; {recovered:.4g} of it recovered"
        print(f"{curves.words(number)}: {text}")
