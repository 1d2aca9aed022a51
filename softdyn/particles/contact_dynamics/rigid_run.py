"""Running a scene of rigid grains by contact dynamics."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles.contact_dynamics import rigid_checkpoint
from softdyn.particles.contact_dynamics.rigid_kernel import get_rigid_kernel
from softdyn.particles.contact_dynamics.rigid_steps import Progress, integrate, list_contacts
from softdyn.particles.contact_dynamics.rigid_system import Collisions, RigidState, RigidSystem
from softdyn.particles.driven import Driven, sum_of
from softdyn.particles.geometry import bare_contacts, directions, find_pairs, flow, lattice
from softdyn.particles.mechanisms.coulomb import Rubbing
from softdyn.particles.mechanisms.inertia import Masses, start_velocities
from softdyn.particles.neighbours import SKIN, Listed
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.particles.system import PreparedScene, ValidatedScene, prepared
from softdyn.particles.until import ends_at_strain
from softdyn.results.carried import carried
from softdyn.results.frame_file import begin
from softdyn.results.origin import about, origin_now
from softdyn.results.state_file import frames_beside, remove
from softdyn.words import listed

if TYPE_CHECKING:
    from softdyn.particles.mechanisms.stress import ImposedStress

Array = NDArray[np.float64]

#: Overlap at the start, in smaller radii, that is rounding of positions.
TOUCHING = 1e-9
#: Steps in which a grain moves by its radius, at the speed that it may get to, and in which it falls by it from rest.
STEPS_OF_RADIUS, STEPS_OF_FALL = 10.0, 20.0
#: Steps of a run in which nothing tells how fast anything is.
STEPS_OF_RUN = 100
#: Imbalance of the energy from which the result warns.
IMBALANCE = 1e-9


def prepare(facts: ValidatedScene) -> RigidSystem:
    """Get the kernel of a scene of rigid grains, and put together what its steps need.

    Raises
    ------
    SceneError, CompileError
    """
    if faults := [*_unknown(facts), *_overlaps(facts)]:
        raise SceneError(listed(faults))
    d, count = facts.x.shape[1], len(facts.x)
    (masses,) = [one for one in facts.mechanisms if isinstance(one, Masses)]
    given = [one for one in facts.mechanisms if isinstance(one, Rubbing)]
    kernel = get_rigid_kernel(d, facts.scene.target)
    made = prepared(facts, (*facts.mechanisms, Collisions()), kernel.law, kernel.target, kernel.fingerprint)
    inertia = np.empty((count, kernel.width))
    inertia[:, :d], inertia[:, d:] = masses.mass[:, None], (masses.moment / facts.radii**2)[:, None]
    free = np.zeros((count + len(facts.walls), kernel.width))
    free[:count] = 1.0
    free[:count, : facts.width][made.fixed] = 0.0
    loads: dict[str, list[Driven]] = {}
    for mechanism in facts.mechanisms:
        if mechanism.load is not None:
            loads.setdefault(mechanism.gives[0], []).append(_padded(mechanism.load, kernel.width))
    return RigidSystem(
        **{field.name: getattr(made, field.name) for field in fields(PreparedScene)},
        kernel=kernel,
        masses=inertia,
        free=free,
        loads={kind: sum_of(some, inertia.shape) for kind, some in loads.items()},
        mu=given[0].mu if given else 0.0,
        restitution=given[0].restitution if given else 0.0,
        dt=facts.scene.step or chosen_step(made, masses.mass),
    )


def _padded(load: Driven, width: int) -> Driven:
    """Forces with those on rotations that nothing acts on."""
    more = width - load.scale.shape[1]
    if not more:
        return load
    base = None if load.base is None else np.pad(load.base, ((0, 0), (0, more)))
    return Driven(load.terms, np.pad(load.scale, ((0, 0), (0, more)), constant_values=1.0), base)


def chosen_step(system: PreparedScene, mass: Array) -> float:
    """Step that resolves the motion of a grain by its radius, by what acts at the start."""
    d, radius = system.dimension, float(system.radii.min())
    pull = float(np.abs(system.force(0.0)[:, :d] / mass[:, None]).max(initial=0.0))
    v, spin = start_velocities(system, [])
    speeds = [np.linalg.norm(v, axis=1), np.abs(spin).max(axis=1, initial=0.0) * system.radii]
    speeds += [np.abs(system.velocity(0.0)).max(axis=1, initial=0.0)]
    if system.wall_velocity is not None:
        speeds.append(np.linalg.norm(system.wall_velocity(0.0), axis=1))
    speed = max(float(some.max(initial=0.0)) for some in speeds)
    speed = max(speed, abs(system.box.shear_rate) * 2 * float(system.radii.max()))
    extent = np.ptp(system.x, axis=0).max() + 2 * radius
    speed = math.hypot(speed, math.sqrt(2 * pull * float(extent)))
    until = float(system.scene.until_t)  # type: ignore[arg-type]
    by_speed = radius / (STEPS_OF_RADIUS * speed) if speed else math.inf
    pull = max(pull, _pull_of_stress(system, mass))
    by_fall = math.sqrt(2 * radius / pull) / STEPS_OF_FALL if pull else math.inf
    return min(by_speed, by_fall, until / STEPS_OF_RUN if math.isinf(by_speed) else until)


def _pull_of_stress(system: PreparedScene, mass: Array) -> float:
    """Acceleration of the lightest grain by an imposed stress on its side."""
    if system.leader is None:
        return 0.0
    d = system.dimension
    side = (2 * float(system.radii.max())) ** (d - 1) * (system.box.depth or 1.0) ** (3 - d)
    imposed = np.abs(cast("ImposedStress", system.leader).values(0.0))
    return float(imposed.max()) * side / float(mass.min())


def _unknown(facts: ValidatedScene) -> list[str]:
    """What a scene of rigid grains cannot have."""
    scene = facts.scene
    given = {
        "[parameters]": bool(scene.parameters),
        "[flow] drag": bool(scene.drag),
        "[contacts] tangential": bool(scene.tangential),
        "[contacts] gap": scene.gap is not None,
        "[contacts] range": scene.range is not None,
        "[friction] rolling": scene.friction is not None and bool(scene.friction.rolling),
        "[friction] twisting": scene.friction is not None and bool(scene.friction.twisting),
    }
    faults = [f"{place} is not known to contact dynamics: leave it out" for place, there in given.items() if there]
    if ends_at_strain(scene):
        faults.append(
            "[until] strain of a shear stress is not known to contact dynamics, whose runs end at a time: leave it out"
        )
    if scene.shear_rate and not facts.box.periodic[:2].all():
        faults.append(
            "[flow] shear_rate shears a box that is periodic along x and y; without drag no grain feels a flow"
        )
    return faults


def _overlaps(facts: ValidatedScene) -> list[str]:
    """Grains that overlap at the start, which rigid ones cannot."""
    x, radii, count = facts.x, facts.radii, len(facts.x)
    i, j, shift = find_pairs(x, radii, facts.box, 0.0, facts.walls, 0.0)
    contacts = bare_contacts(i, j, shift, radii)
    _, r = directions(contacts, x, lattice(facts.box, 0.0), facts.walls)
    smaller = np.minimum(radii[i], np.append(radii, np.full(len(facts.walls), np.inf))[j])
    depth = contacts.S - r
    deep = np.flatnonzero(depth > TOUCHING * smaller)
    if not len(deep):
        return []
    deep = deep[np.argsort(-depth[deep], kind="stable")]
    named = [
        f"particle {i[c]} and {f'particle {j[c]}' if j[c] < count else f'wall {j[c] - count}'} by {depth[c]:.4g}"
        for c in deep[:5]
    ]
    more = [f"and {len(deep) - 5} more pairs"] if len(deep) > 5 else []
    return [
        f"rigid grains must not overlap at the start: {', '.join([*named, *more])}, at most "
        f"{depth[deep[0]] / smaller[deep[0]]:.2g} of the smaller radius; move them apart, or make them smaller"
    ]


def simulate(
    facts: ValidatedScene,
    progress: Progress | None = None,
    checkpoint: Path | str | None = None,
    resume: bool = False,
    keep: bool = False,
    on_frame: Callable[[Frame], None] | None = None,
) -> ParticleResult:
    """Integrate a scene of rigid grains; see :func:`softdyn.particles.particle_run.simulate_particles`.

    Parameters
    ----------
    facts : ValidatedScene
    progress, checkpoint, resume, keep, on_frame
        See :func:`softdyn.particles.particle_run.simulate_particles`.

    Raises
    ------
    SceneError, CompileError, IntegrationError
    """
    began = time.perf_counter()
    checkpoint = None if checkpoint is None else Path(checkpoint)
    system = prepare(facts)
    key = "" if checkpoint is None else rigid_checkpoint.fingerprint(system)
    if resume and checkpoint is not None and checkpoint.exists():
        state = rigid_checkpoint.load(checkpoint, key, system)
    else:
        state = start_of(system)
        if checkpoint is not None:
            beside: dict[str, NDArray[Any]] = {}
            made = about(origin_now(facts.scene, system.fingerprint), beside)
            state.frames = begin(frames_beside(checkpoint), Frame, {"key": key, **made}, beside)

    def go(after: Callable[[], None] | None) -> None:
        integrate(system, state, progress, after, on_frame)

    def save() -> None:
        rigid_checkpoint.save(cast(Path, checkpoint), state, key)

    carried(go, checkpoint, save, lambda: _result(system, state, began), lambda: state.t)
    result = _result(system, state, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def start_of(system: RigidSystem) -> RigidState:
    """State at the start; in a sheared box grains move with the flow, unless their velocities are given."""
    count, d = system.x.shape
    velocities, spins = start_velocities(system, [])
    if system.scene.velocities is None:
        velocities = flow(system.box, system.x)
    v = np.zeros((count, system.kernel.width))
    v[:, :d], v[:, d : d + spins.shape[1]] = velocities, spins * system.radii[:, None]
    nothing = np.zeros((0, d))
    none = np.zeros(0, np.int32)
    state = RigidState(
        t=0.0,
        began=0.0,
        goal=0.0,
        step=0,
        steps=0,
        x=system.x.copy(),
        v=v,
        contacts=bare_contacts(none, none, np.zeros((0, d), np.int64), system.radii),
        impulses=nothing,
        last_dt=0.0,
        normals=nothing,
        distances=np.zeros(0),
        listed=Listed(system.x.copy(), lattice(system.box, 0.0), system.walls0, 1.0),
        box=system.box,
        walls=system.walls,
        work=dict.fromkeys(system.works, 0.0),
        counts=dict.fromkeys(("steps", "rejected", "made", "dropped", "listings"), 0),
    )
    list_contacts(system, state, SKIN * float(system.radii.min()))
    return state


def _result(system: RigidSystem, state: RigidState, began: float) -> ParticleResult:
    given = sum(state.work[name] for name in system.given)
    taken = sum(amount for name, amount in state.work.items() if name not in system.given)
    count = len(state.x)
    kinetic = float(np.sum(system.masses * state.v[:count] ** 2))
    # of grains that fly freely all terms are rounding of their energy
    size = sum(abs(amount) for amount in state.work.values()) + kinetic
    energy = {**state.work, "stored": 0.0, "imbalance": (given - taken) / size if size else 0.0}
    effort = state.effort.told()
    stats: dict[str, Any] = {
        "method": f"contact dynamics: implicit Euler, order 1, steps of {system.dt:.4g} at most"
        + ("" if system.scene.step else ", chosen by size and speeds"),
        **state.counts,
        "sweeps": effort["sweeps"],
        "newton_iterations": effort["newton_steps"],
        "newton_solved": effort["newton_solved"],
        "newton_failed": effort["newton_failed"],
        "operations": effort["operations"],
        "linear_solver": "sparse LU" if effort["newton_steps"] else "",
        "force_residual": max((row[2] for row in state.history), default=0.0),
        "step": system.dt,
        "wall_s": time.perf_counter() - began,
        "compile_s": system.kernel.compile_s,
        "kernel": system.kernel.key,
        "given": list(system.given),
        "warnings": [],
    }
    if abs(energy["imbalance"]) > IMBALANCE:
        stats["warnings"].append(
            f"the balance of energy is off by {energy['imbalance']:.1e} of the sum of its terms, {size:.3g}"
        )
    return gather(system, list(state.frames), state.history, energy, stats)
