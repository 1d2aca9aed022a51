"""``softdyn run SCENE --engine lammps`` and ``softdyn generate LAW --target lammps``."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from softdyn.errors import IntegrationError, SceneError
from softdyn.lammps.carried import SHARE, crossover_words, prepared
from softdyn.lammps.inputs import plugin, run_times, write_inputs, write_plugin
from softdyn.lammps.lammps_run import simulate_in_lammps
from softdyn.laws import find
from softdyn.particles.command import LINES, stress_words
from softdyn.particles.files import read_particle_scene
from softdyn.particles.results import ParticleResult
from softdyn.results.state_file import save_result
from softdyn.results.writers import require_writer
from softdyn.scene.reading import is_particle_scene
from softdyn.scene.stock_scenes import found_scene


def run_in_lammps(path: Path, content: Mapping[str, Any], options: Any) -> int:
    """Run a scene file by LAMMPS, and tell what came out.

    Parameters
    ----------
    path : Path
        The scene.
    content : mapping
        As read from it.
    options : namespace
        Of the command line.

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError
    """
    output: Path | None = options.output
    if not is_particle_scene(content):
        raise SceneError(f"--engine lammps is for scenes of many particles, and {path} is none")
    if options.resume:
        raise SceneError("--resume: runs of LAMMPS go on from restart files of its own; see .docs/lammps.md")
    if output is not None and output.suffix != ".npz":
        require_writer(output)
    scene = read_particle_scene(path)
    folder = None if output is None else output.with_suffix(".lammps")
    ranks = 1 if options.ranks is None else options.ranks
    try:
        result = simulate_in_lammps(scene, ranks, options.dt, folder, _tell)
    except IntegrationError as error:
        if isinstance(error.partial, ParticleResult) and output is not None:
            kept = output.with_suffix(".partial.npz")
            error.partial.save(kept)
            raise IntegrationError(f"{error}; the frames up to then are in {kept}, its files in {folder}") from None
        raise
    written = [] if output is None else list(dict.fromkeys((output.with_suffix(".npz"), output)))
    for one in written:
        save_result(result, one, None)
    stats = result.stats
    if options.json:
        energy = {"energy": dict(result.energy), "stats": dict(stats), "stress": result.stress[-1].tolist()}
        print(
            json.dumps({"status": "success", "law": result.law, "target": "lammps", "t": float(result.t[-1]), **energy})
        )
        return 0
    print(f"{result.law}, {len(result.radii)} particles: {stats['method']}")
    if result.box.size > 1 and all(length < float("inf") for length in result.box):
        eta = scene.parameters.get("eta")
        for k in range(0, len(result), max(1, len(result) // LINES)):
            frame: Any = SimpleNamespace(t=float(result.t[k]), stress=result.stress[k], gradient=result.gradient[k])
            print(stress_words(frame, float(eta) if isinstance(eta, (int, float)) else None))
    shown = ", ".join(f"{name} {value:.4g}" for name, value in result.energy.items() if value and name != "imbalance")
    print(f"  energy: {shown or 'none'}; unaccounted for {result.energy['imbalance']:.1e} of it")
    print(f"  {stats['crossover']}")
    print(f"  run {stats['wall_s']:.3g} s, plugin {stats['compile_s']:.3g} s")
    if written:
        print(f"wrote {' and '.join(map(str, written))}; the files of LAMMPS are in {folder}")
    return 0


def _tell(words: str) -> None:
    """Say on stderr what is about to be run."""
    print(f"softdyn: {words}", file=sys.stderr, flush=True)


def generate_lammps(options: Any) -> int:
    """Write a plugin, its build line, and what LAMMPS reads of a scene.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    if options.scene is None or options.folder is None:
        raise SceneError("generate LAW --target lammps needs --scene SCENE, of many particles, and -o DIR")
    if options.fix:
        raise SceneError("--fix is for kernels of two particles: LAMMPS is given parameters as numbers")
    scene = read_particle_scene(found_scene(options.scene))
    if find(options.law).name != find(scene.law).name or find(options.law).path != find(scene.law).path:
        raise SceneError(f"the scene is of the law {scene.law}, not of {options.law}")
    ready = prepared(scene)
    manifest, dt = plugin(ready.system), SHARE * ready.limit
    if dt == float("inf"):
        dt = float(run_times(ready.system)[-1]) / 1000
    name = f"{manifest['name']}_{options.scene.stem}"
    files = write_plugin(manifest, options.folder, name) + write_inputs(ready, manifest, dt, options.folder, name)
    for file in files:
        print(f"wrote {file}")
    print(f"sh {name}.build.sh && mpiexec -n 4 lmp -in {name}.in     in {options.folder}")
    print(crossover_words(ready, dt), file=sys.stderr)
    return 0
