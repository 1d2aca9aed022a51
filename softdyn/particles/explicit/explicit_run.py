"""Running a scene of grains by explicit steps."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from softdyn.particles.explicit import grain_checkpoint
from softdyn.particles.explicit.given import groups_of
from softdyn.particles.explicit.grain_kernels import GrainKernel, get_grain_kernel
from softdyn.particles.explicit.grains import Grains, GrainSystem
from softdyn.particles.explicit.steps import Progress, frame_now, integrate, start_of, threads_for, walls_at
from softdyn.particles.explicit.touching import exchanged, touching
from softdyn.particles.geometry import flow
from softdyn.particles.mechanisms.coulomb import Rubbing
from softdyn.particles.mechanisms.inertia import GYRATION, Masses, start_velocities
from softdyn.particles.parameters import mixed_parameters, uniform_values, varying_parameters
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.particles.system import PreparedScene, ValidatedScene, prepared
from softdyn.results.carried import carried
from softdyn.results.frame_file import begin
from softdyn.results.origin import about, origin_now
from softdyn.results.state_file import frames_beside, remove

Array = NDArray[np.float64]

#: Imbalance of the energy from which the result warns.
IMBALANCE = 0.01


def prepare(facts: ValidatedScene) -> GrainSystem:
    """Get the kernel of a scene of grains, and put together what its steps need.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    scene, d = facts.scene, facts.x.shape[1]
    given = [one for one in facts.mechanisms if isinstance(one, Rubbing)]
    rubbing = given[0] if given else Rubbing(0.0, 0.0, 0.0, 0.0)
    (masses,) = [one for one in facts.mechanisms if isinstance(one, Masses)]
    varying = tuple(name for name in varying_parameters(facts) if name not in ("R", "size_ratio"))
    sheared = bool(scene.shear_rate) or any(mechanism.moves_box for mechanism in facts.mechanisms)
    needs = {
        "d": d,
        "rotations": facts.width - d,
        "varying": tuple(sorted(varying)),
        "rolling": rubbing.rolling > 0,
        "twisting": rubbing.twisting > 0,
        "periodic": bool(facts.box.periodic.any()),
        "sheared": sheared,
    }
    kernel = get_grain_kernel(scene.law, scene.target, needs)
    p = uniform_values(facts, kernel)
    made = prepared(facts, facts.mechanisms, kernel.law, kernel.target, kernel.fingerprint)
    own = {"dashpots": kernel.damped, "k_t": kernel.rotations > 0}
    works = [name for name, there in own.items() if there and name not in made.works]
    made = replace(made, works=(*made.works, *works))
    load = np.zeros((len(facts.x), d)) if made.force.base is None else made.force.base[:, :d].copy()
    walls = facts.walls
    assert scene.inertia is not None
    spun = 1 + 1 / GYRATION[scene.inertia.shape]
    if rubbing.rolling or rubbing.twisting:
        spun += 4 / GYRATION[scene.inertia.shape]
    return GrainSystem(
        **{field.name: getattr(made, field.name) for field in fields(PreparedScene)},
        kernel=kernel,
        p=p,
        q=_table(facts, kernel),
        kinds=len(facts.names) + len(walls),
        mass=masses.mass,
        moment=masses.moment,
        load=load,
        groups=groups_of(made),
        wall_normal=np.array([wall.normal for wall in walls]).reshape(len(walls), d),
        wall_part=np.array([1.0 if wall.rigid else 0.5 for wall in walls]),
        mu=rubbing.mu,
        rolling=rubbing.rolling,
        twisting=rubbing.twisting,
        spun=spun,
    )


def _table(facts: ValidatedScene, kernel: GrainKernel) -> Array:
    """Varying parameters of each pair of kinds: species, and behind them the walls."""
    names, walls = len(facts.names), len(facts.walls)
    kinds, count = names + walls, len(facts.x)
    table = np.zeros((len(kernel.varying), kinds, kinds))
    if not kernel.varying:
        return table
    first = [int(np.flatnonzero(facts.species == one)[0]) for one in range(names)]
    i = np.repeat(first, kinds)
    j = np.tile([*first, *(count + w for w in range(walls))], names)
    table[:, :names] = mixed_parameters(facts, kernel, i, j).reshape(-1, names, kinds)
    return table


def simulate(
    facts: ValidatedScene,
    progress: Progress | None = None,
    checkpoint: Path | str | None = None,
    resume: bool = False,
    keep: bool = False,
    on_frame: Callable[[Frame], None] | None = None,
) -> ParticleResult:
    """Integrate a scene of grains; see :func:`softdyn.particles.particle_run.simulate_particles`.

    Parameters
    ----------
    facts : ValidatedScene
    progress, checkpoint, resume, keep, on_frame
        See :func:`softdyn.particles.particle_run.simulate_particles`.

    Raises
    ------
    SceneError, LawError, CompileError, IntegrationError
    """
    began = time.perf_counter()
    checkpoint = None if checkpoint is None else Path(checkpoint)
    system = prepare(facts)
    key = "" if checkpoint is None else grain_checkpoint.fingerprint(system)
    if resume and checkpoint is not None and checkpoint.exists():
        state = grain_checkpoint.load(checkpoint, key)
    else:
        v, spin = start_velocities(facts, [])
        if facts.scene.velocities is None and system.kernel.sheared:
            v = flow(system.box, facts.x)
        state = start_of(system, v, spin)
        if checkpoint is not None:
            beside: dict[str, NDArray[Any]] = {}
            made = about(origin_now(facts.scene, system.fingerprint), beside)
            state.frames = begin(frames_beside(checkpoint), Frame, {"key": key, **made}, beside)
        if system.times[0] == 0.0:
            state.frames.append(frame_now(system, state))

    def go(after: Callable[[], None] | None) -> None:
        integrate(system, state, progress, after, on_frame)

    def save() -> None:
        grain_checkpoint.save(cast(Path, checkpoint), state, key)

    carried(go, checkpoint, save, lambda: _result(system, state, began), lambda: state.t)
    result = _result(system, state, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def _result(system: GrainSystem, state: Grains, began: float) -> ParticleResult:
    work = exchanged(system, state, touching(system, state, *walls_at(system, state.t)))
    given = sum(work[name] for name in system.given)
    taken = sum(amount for name, amount in work.items() if name not in system.given)
    # of grains that fly freely all terms are rounding of their energy
    size = sum(abs(amount) for amount in work.values()) + 2 * state.kinetic0 + work["kinetic"]
    energy = {**work, "imbalance": (given - taken) / size if size else 0.0}
    lengths = [row[1] for row in state.history_rows]
    stats: dict[str, Any] = {
        "method": "explicit: velocity Verlet, order 2",
        **state.counts,
        "threads": threads_for(system),
        "shortest_step": min(lengths, default=0.0),
        "longest_step": max(lengths, default=0.0),
        "wall_s": time.perf_counter() - began,
        "compile_s": system.kernel.compile_s,
        "kernel": system.kernel.key,
        "given": list(system.given),
        "warnings": [],
    }
    if abs(energy["imbalance"]) > IMBALANCE:
        stats["warnings"].append(
            f"the balance of energy is off by {energy['imbalance']:.1e} of the sum of its terms, {size:.3g}: ask for a "
            "smaller rtol"
        )
    return gather(system, list(state.frames), state.history_rows, energy, stats)
