"""``softdyn run`` for a scene of a fluid."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from softdyn.errors import SceneError
from softdyn.fluid.fluid_result import FluidResult
from softdyn.fluid.fluid_run import Progress, simulate_fluid
from softdyn.fluid.fluid_scene import FluidScene, read_fluid_scene
from softdyn.results.state_file import remove, save_result
from softdyn.results.writers import require_writer
from softdyn.scene.reading import is_suspension_scene, read_toml
from softdyn.terminal import as_it_is

#: Formats that results of a fluid are saved in.
ENDINGS = (".npz", ".pvd", ".csv", ".nc")


def run_fluid(path: Path, output: Path | None, resume: bool, as_json: bool) -> int:
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
    if output is not None and output.suffix not in ENDINGS:
        raise SceneError(f"cannot save to {output}: of a fluid the ending must be one of {', '.join(ENDINGS)}")
    if output is not None and output.suffix != ".npz":
        require_writer(output)  # before the run, not after it
    if resume and output is None:
        raise SceneError("--resume goes on from the checkpoint of a run with -o FILE: name that file")
    scene, simulate = _read(path)
    checkpoint = output.with_suffix(".checkpoint.npz") if output is not None and not scene.steady else None
    if resume and scene.steady:
        raise SceneError("--resume is for runs in time: a steady flow is found anew")
    if resume and checkpoint is not None and not checkpoint.exists():
        print(f"softdyn: there is no {checkpoint}; starting anew", file=sys.stderr)
    with _progress_bar(scene) as progress:
        result = simulate(scene, progress, checkpoint, resume, True)
    written = [] if output is None else list(dict.fromkeys((output.with_suffix(".npz"), output)))
    for file in written:
        save_result(result, file, checkpoint)
    if checkpoint is not None:
        remove(checkpoint)
    for warning in result.warnings:
        print(f"softdyn: warning: {warning}", file=sys.stderr)
    if as_json:
        print(json.dumps(_summary(result)))
        return 0
    _tell(result)
    if written:
        print(f"wrote {' and '.join(map(str, written))}")
    return 0


def _read(path: Path) -> tuple[FluidScene, Callable[..., FluidResult]]:
    """A scene, with grains or without, and what runs it."""
    if not is_suspension_scene(read_toml(path)):
        return read_fluid_scene(path), simulate_fluid
    from softdyn.suspension.suspension_run import simulate_suspension
    from softdyn.suspension.suspension_scene import read_suspension_scene

    return read_suspension_scene(path), simulate_suspension


def _boundaries(result: FluidResult) -> list[str]:
    return [str(name) for name in result.boundary_names if f"force_{name}" in result.arrays]


def _summary(result: FluidResult) -> dict[str, object]:
    last = {
        name: {"force": result.arrays[f"force_{name}"][-1].tolist(), "flux": float(result.arrays[f"flux_{name}"][-1])}
        for name in _boundaries(result)
    }
    return {
        "status": "success",
        "kind": result.kind,
        "target": result.target,
        "elements": result.stats["elements"],
        "unknowns": result.stats["unknowns"],
        "t": float(result.t[-1]) if len(result) else None,
        "boundaries": last,
        "dissipation": float(result.dissipation[-1]),
        "stats": dict(result.stats),
    }


def _tell(result: FluidResult) -> None:
    stats = result.stats
    print(f"fluid, target {result.target}, {stats['elements']}, {stats['unknowns']} unknowns: {stats['method']}")
    if "steps" in stats:
        print(
            f"  t = {result.step_t[-1]:.6g} in {stats['steps']} steps, {stats['rejected']} rejected; "
            f"{stats['iterations']} Newton iterations, {stats['linear_factorisations']} factors"
        )
    else:
        thicker = f", by way of {stats['fluids'] - 1} thicker fluids" if stats["fluids"] > 1 else ""
        print(f"  {int(result.step_newton[-1])} Newton iterations{thicker}")
    for name in _boundaries(result):
        force = ", ".join(f"{part: .6e}" for part in result.arrays[f"force_{name}"][-1])
        print(f"  {name:12} force ({force}), flux out {result.arrays[f'flux_{name}'][-1]: .6e}")
    if "radii" in result.arrays:
        told = f"exchange {stats['exchange_imbalance']:.1e}, volume of the grains to {stats['volume_imbalance']:.1e}"
        print(f"  {stats['grains']} grains, width {stats['width']:.4g}; {stats['repeats']} repeats; closes to: {told}")
        if stats["grains"]:
            mean = ", ".join(f"{part: .6e}" for part in result.v[-1].mean(axis=0))
            print(f"  mean velocity of the grains ({mean})")
            from softdyn.suspension.stresses import told_stresses

            if words := told_stresses(result):
                print(f"  {words}")
    print(
        f"  residual {stats['residual']:.1e}; mass closes to {stats['mass_imbalance']:.1e}, momentum to "
        f"{stats['momentum_imbalance']:.1e}; run {stats['wall_s']:.3g} s"
    )


@contextmanager
def _progress_bar(scene: FluidScene) -> Iterator[Progress | None]:
    """Progress callback that draws a bar on a terminal, and None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    shape = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining} {postfix}" if scene.until_t else "{elapsed} {postfix}"
    with tqdm(total=1.0, delay=0.5, leave=False, bar_format=shape, file=as_it_is(sys.stderr)) as bar:

        def update(t: float, steps: int, iterations: int, residual: float) -> None:
            if scene.until_t:
                bar.n = min(1.0, t / scene.until_t)
            each = f"{iterations / max(steps, 1):.1f} Newton each"
            where = f"t={t:.4g} step {steps}, {each}" if steps else f"Newton {iterations}"
            bar.set_postfix_str(f"{where}, residual {residual:.0e}", refresh=True)

        yield update
