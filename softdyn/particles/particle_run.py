"""Running a scene of many particles."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.kernels import choose_target
from softdyn.one_thread import in_one_thread
from softdyn.particles import checkpoint as checkpoints
from softdyn.particles.contact_kernels import get_contact_kernel
from softdyn.particles.energy import CARRIED, ELASTIC
from softdyn.particles.force_balance import Newton
from softdyn.particles.integrate import Progress, integrate
from softdyn.particles.loose_particles import is_loose, no_contact_kernel
from softdyn.particles.methods import method_of, module_of
from softdyn.particles.parameters import require_rest, uniform_values, varying_parameters
from softdyn.particles.particle_keys import ParticleScene
from softdyn.particles.particle_scene import check, range_faults
from softdyn.particles.pulled_films import pulled_films
from softdyn.particles.results import Frame, ParticleResult, gather
from softdyn.particles.start import start
from softdyn.particles.state import State, present, stored_energy
from softdyn.particles.system import PreparedScene, System, ValidatedScene, turns_freely, with_mechanisms
from softdyn.results.carried import carried
from softdyn.results.frame_file import begin
from softdyn.results.origin import about, origin_now
from softdyn.results.state_file import frames_beside, remove
from softdyn.traits import traits_of
from softdyn.words import listed

Array = NDArray[np.float64]
#: Words by which warnings that a number may be wrong are known: of the energy, of what is given as a function of time.
UNBALANCED, UNSEEN = "the balance of energy is off by", "changes too fast to be bounded"
DOUBTFUL = "has kinks or jumps too many, or too close, to be told"
#: Imbalance of the energy, in units of rtol, from which the result warns: errors of some steps may add up to a few.
IMBALANCE = 3.0


@in_one_thread
def simulate_particles(
    scene: ParticleScene,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    keep: bool = False,
    on_frame: Callable[[Frame], None] | None = None,
) -> ParticleResult:
    """Integrate a scene.

    Parameters
    ----------
    scene : ParticleScene
    progress : function of (t, steps, Newton iterations), optional
        Called after every step.
    checkpoint : str or Path, optional
        File to which the state is written now and then, and when the run is interrupted (SIGINT, or SIGTERM, which
        raises :class:`softdyn.signals.Terminated`), at the end of a step, or cannot go on; it is removed at the end.
    resume : bool
        Whether to go on from that file, if it is there.
    keep : bool
        Whether to leave it at the end, for who saves the result to remove it then.
    on_frame : function of a Frame, optional
        Called with each frame behind the first, as it comes.

    Returns
    -------
    ParticleResult

    Raises
    ------
    SceneError
        If the scene cannot be used.
    IntegrationError
        If it cannot be carried to its end: naming the particles or the contact at fault. Its attribute ``partial`` is
        the result up to the last good state.

    Examples
    --------
    >>> from softdyn.particles import ParticleScene, random_packing, simulate
    >>> x, radii, box = random_packing(20, 2, 0.9, [1.0, 1.4], seed=1)
    >>> scene = ParticleScene(
    ...     law="droplet", parameters={"sigma": 1.0, "eta": 1.0}, positions=x, radii=radii, box=list(box), gap=0.02,
    ...     range=0.5, shear_rate=1e-3, drag=1.0, until_strain=0.1,
    ... )
    >>> result = simulate(scene)
    >>> result.x[-1].shape
    (20, 2)
    """
    began = time.perf_counter()
    checkpoint = None if checkpoint is None else Path(checkpoint)
    facts = check(scene)
    method = method_of(facts)
    if method != "implicit":
        result: ParticleResult = module_of(method).simulate(facts, progress, checkpoint, resume, keep, on_frame)
        return result
    system = ready(facts)
    newton = Newton(recalls=checkpoint is not None)
    key = "" if checkpoint is None else checkpoints.fingerprint(system)
    if resume and checkpoint is not None and checkpoint.exists():
        state, newton = checkpoints.load(checkpoint, key, system)
    else:
        state = start(system, newton)
        if checkpoint is not None:
            beside: dict[str, NDArray[Any]] = {}
            made = about(origin_now(scene, system.kernel.fingerprint), beside)
            state.frames = begin(frames_beside(checkpoint), Frame, {"key": key, **made}, beside)

    def go(after: Callable[[], None] | None) -> None:
        integrate(system, newton, state, progress, after, on_frame)

    def save() -> None:
        checkpoints.save(cast(Path, checkpoint), state, newton, key)

    carried(go, checkpoint, save, lambda: _result(system, newton, state, began), lambda: state.t)
    result = _result(system, newton, state, began)
    if checkpoint is not None and not keep:
        remove(checkpoint)
    return result


def kernel_needs(facts: ValidatedScene) -> dict[str, Any]:
    """What a scene needs of the kernel of its contacts; the fields of ``derive.contact_equations.ContactNeeds``."""
    return {
        "varying": tuple(sorted(varying_parameters(facts))),
        "fading": math.isfinite(facts.reach) and _fades(facts),
        "tangential": bool(facts.scene.tangential),
        "drag": bool(facts.scene.drag),
        "rubbing": facts.scene.friction is not None,
    }


def _fades(facts: ValidatedScene) -> bool:
    """Whether contacts fade before they end: those of dry particles end where surfaces part."""
    traits = traits_of(facts.scene.law)
    return traits.kind != "dry" or traits.remote


def prepare(scene: ParticleScene) -> System:
    """Check a scene, get its kernel, and make its mechanisms ready.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    return ready(check(scene))


def prepare_any(scene: ParticleScene) -> PreparedScene:
    """Check a scene, whatever its method, and make all ready that a run of it needs.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    facts = check(scene)
    method = method_of(facts)
    if method == "implicit":
        return ready(facts)
    made: PreparedScene = module_of(method).prepare(facts)
    return made


def ready(facts: ValidatedScene) -> System:
    """Get the kernel of soft contacts, and make the mechanisms ready.

    Raises
    ------
    SceneError, LawError, CompileError
    """
    scene = facts.scene
    if not is_loose(scene) and (faults := range_faults(scene, facts.radii)):
        raise SceneError(listed(faults))
    if is_loose(scene):
        kernel = no_contact_kernel(choose_target(scene.target), bool(scene.drag))
        return with_mechanisms(facts, kernel, uniform_values(facts, kernel), facts.mechanisms)
    kernel = get_contact_kernel(scene.law, scene.target, **kernel_needs(facts))
    require_rest(facts)
    if scene.range is None and not kernel.bounded:
        raise SceneError(
            "the law's friction zeta grows without bound, or has no limit, as h -> oo: with drag it would hold distant "
            "particles together; give contacts a range, [contacts] range"
        )
    return with_mechanisms(facts, kernel, uniform_values(facts, kernel), facts.mechanisms)


def _result(system: System, newton: Newton, state: State, began: float) -> ParticleResult:
    stored = stored_energy(present(system, state), state) - state.stored0
    work = {name: state.work[name] for name in system.works}
    put_in = system.given
    given = sum(work[name] for name in put_in)
    taken = stored + sum(amount for name, amount in work.items() if name not in put_in)
    size = sum(abs(value) for value in work.values()) + abs(stored)
    stats: dict[str, Any] = {
        "method": "SDIRK of order 3 in positions and gaps",
        **state.counts,
        **{f"newton_{name}": number for name, number in newton.counts.items()},
        **(newton.solver.counts if newton.solver else {}),
        "linear_solver": newton.solver.method if newton.solver else "",
        "force_residual": max((row[2] for row in state.history), default=0.0),
        "wall_s": time.perf_counter() - began,
        "compile_s": system.kernel.compile_s,
        "kernel": system.kernel.key,
    }
    # where particles go with the flow, or fly, and touch nothing, all terms are rounding of this
    carried = state.work[CARRIED] + sum(one.carried(system, state.kept) for one in system.having["carried"])
    known = size > 1e-12 * carried
    energy = {**work, "stored": stored, "imbalance": (given - taken) / size if known else 0.0}
    if turns_freely(system):
        stats["torque_removed"] = state.turned
    for mechanism in system.having["stats"]:
        stats |= mechanism.stats()
    stats["given"] = list(put_in)
    stats["warnings"] = []
    solver = newton.solver
    if solver is not None and solver.certain and solver.counts["krylov"] and not solver.counts["factorisations"]:
        stats["warnings"].append(
            "so many particles without drag are not searched for motions that nothing resists, since the matrix is too "
            "large to be factorised: rattlers and loose clusters may drift ([flow] drag = 1 resists them)"
        )
    # what the steps make of it, what they were expected to, and what is left
    stats["energy_error"] = (state.work[ELASTIC] - stored) / size if size else 0.0
    stats["energy_error_expected"] = state.work_error / size if size else 0.0
    unexplained = energy["imbalance"] - stats["energy_error"]
    if abs(unexplained) > IMBALANCE * system.rtol and known:
        stats["warnings"].append(
            f"{UNBALANCED} {unexplained:.1e} of the sum of its terms, {size:.3g}, which no error of "
            f"the steps explains: more than {IMBALANCE:g} rtol"
        )
    elif abs(stats["energy_error"]) > IMBALANCE * system.rtol + stats["energy_error_expected"] and known:
        stats["warnings"].append(
            f"{UNBALANCED} {stats['energy_error']:.1e} of the sum of its terms, {size:.3g}: the "
            f"steps were expected to make {stats['energy_error_expected']:.1e} at most; ask for a smaller rtol"
        )
    stats["warnings"] += [
        f"{name} {UNSEEN} near t={when:.6g}, however short the steps: what it does there may be missed"
        for name, when in state.unseen.items()
    ]
    stats["warnings"] += [
        f"{name} {DOUBTFUL} from one another: what it does there may be missed"
        for name in dict.fromkeys(function.name for function in system.functions if function.doubtful)
    ]
    stats["pulled"] = list(pulled_films(state.pulled))
    stats["warnings"] += stats["pulled"]
    return gather(system, list(state.frames), state.history, energy, stats)
