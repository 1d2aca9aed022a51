"""``softdyn run`` for a scene of many particles."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from softdyn.errors import SceneError
from softdyn.particles.files import read_particle_scene
from softdyn.particles.integrate import Progress
from softdyn.particles.names import is_number
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import Frame
from softdyn.particles.time_functions import is_driven
from softdyn.particles.until import run_end
from softdyn.results.state_file import remove, save_result
from softdyn.results.writers import require_writer
from softdyn.terminal import as_it_is

#: Frames of a run that are told of as they come, about.
LINES = 20


def run_particles(path: Path, output: Path | None, resume: bool, as_json: bool) -> int:
    """Run a scene file, and tell what came out.

    An output in another format than .npz is written beside the .npz, which holds everything.

    Parameters
    ----------
    path : Path
        The scene.
    output : Path, optional
        File of the result.
    resume : bool
        Whether to go on from the checkpoint beside that.
    as_json : bool
        Whether to tell what came out as JSON.

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError
    """
    if output is not None and output.suffix != ".npz":
        require_writer(output)  # before the run, not after it
    if resume and output is None:
        raise SceneError("--resume goes on from the checkpoint of a run with -o FILE: name that file")
    scene = read_particle_scene(path)
    checkpoint = output.with_suffix(".checkpoint.npz") if output is not None else None
    if resume and checkpoint is not None and not checkpoint.exists():
        print(f"softdyn: there is no {checkpoint}; starting anew", file=sys.stderr)
    with _progress_bar(scene) as progress:
        result = simulate_particles(scene, progress, checkpoint, resume, True, None if as_json else _told(scene))
    written = [] if output is None else list(dict.fromkeys((output.with_suffix(".npz"), output)))
    for path in written:
        save_result(result, path, checkpoint)
    if checkpoint is not None:
        remove(checkpoint)
    summary = {
        "status": "success",
        "law": result.law,
        "target": result.target,
        "particles": len(result.radii),
        "t": float(result.t[-1]),
        "contacts": int(result.step_contacts[-1]) if len(result.step_contacts) else len(result.contacts(-1)["h"]),
        "stress": result.stress[-1].tolist(),
        "energy": dict(result.energy),
        "stats": dict(result.stats),
    }
    for warning in result.stats["warnings"]:
        print(f"softdyn: warning: {warning}", file=sys.stderr)
    if as_json:
        print(json.dumps(summary))
        return 0
    stats, energy = result.stats, result.energy
    print(f"{result.law}, target {result.target}, {len(result.radii)} particles: {stats['method']}")
    print(f"  t = {result.t[-1]:.6g} in {stats['steps']} steps, {stats['rejected']} rejected{_solved(stats)}")
    changed = f"; {stats['made']} made and {stats['dropped']} dropped" if "made" in stats else ""
    print(f"  {summary['contacts']} contacts within range{changed}, looked for {stats.get('listings', 0)} times")
    shown = ", ".join(f"{name} {value:.4g}" for name, value in energy.items() if value and name != "imbalance")
    print(f"  energy: {shown or 'none'}; unaccounted for {energy['imbalance']:.1e} of it")
    balance = f"forces balance to {stats['force_residual']:.1e}; " if "force_residual" in stats else ""
    print(f"  {balance}run {stats['wall_s']:.3g} s, kernel {stats['compile_s']:.3g} s")
    if written:
        print(f"wrote {' and '.join(map(str, written))}")
    return 0


def _solved(stats: Mapping[str, Any]) -> str:
    """What a method that solves for its steps tells of that."""
    if "newton_iterations" not in stats:
        return ""
    return f"; {stats['newton_iterations']} Newton iterations ({stats['linear_solver'] or 'no linear system'})"


def _told(scene: ParticleScene) -> Callable[[Frame], None] | None:
    """What tells of frames as they come: stress, pressure and viscosity; None where there is no stress."""
    box = () if scene.box is None else scene.box
    if len(box) < 2 or any(length is None for length in box):
        return None
    given = scene.stress_viscosity if scene.stress_viscosity is not None else scene.parameters.get("eta")
    eta = float(given) if is_number(given) else None  # type: ignore[arg-type]
    count = int(scene.times) if isinstance(scene.times, (int, np.integer)) else len(scene.times)
    every, told = max(1, count // LINES), 0

    def tell(frame: Frame) -> None:
        nonlocal told
        told += 1
        if told % every and told != count - 1:
            return
        text = stress_words(frame, eta)
        if sys.stderr.isatty():
            from tqdm import tqdm

            tqdm.write(text, file=sys.stdout)
        else:
            print(text, flush=True)

    return tell


def stress_words(frame: Frame, eta: float | None) -> str:
    """Stress, pressure and viscosity of a frame, in words."""
    contacts, rate = float(frame.stress[0, 1] + frame.stress[1, 0]) / 2, float(frame.gradient[0, 1])
    pressure = -float(np.trace(frame.stress)) / len(frame.stress)
    fluid = eta * rate if eta is not None else 0.0
    text = f"  t = {frame.t:.4g}: shear stress {contacts + fluid:.4g}"
    text += f" ({contacts:.4g} of it by contacts)" if fluid else ""
    text += f", pressure {pressure:.4g}"
    if rate and eta is not None:
        text += f", viscosity {(contacts + fluid) / rate:.4g}, {(contacts + fluid) / fluid:.4g} times the fluid's"
    return text


@contextmanager
def _progress_bar(scene: ParticleScene) -> Iterator[Progress | None]:
    """Progress callback that draws a bar on a terminal, and None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    end = run_end(scene)
    shape = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining} {postfix}"
    with tqdm(total=1.0, delay=0.5, leave=False, bar_format=shape, file=as_it_is(sys.stderr)) as bar:
        draw: Callable[[str], None] = lambda text: bar.set_postfix_str(text, refresh=True)  # noqa: E731

        def update(t: float, steps: int, iterations: int) -> None:
            bar.n = min(1.0, t / end)
            rate = 0.0 if is_driven(scene.shear_rate) else abs(float(scene.shear_rate))  # type: ignore[arg-type]
            where = f"strain={t * rate:.4g}" if rate else f"t={t:.4g}"
            draw(f"{where} step {steps}, {iterations / max(steps, 1):.1f} iterations each")

        yield update
