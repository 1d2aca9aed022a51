"""What a kernel says of given states: the deflection that balances a force, the outputs, what the drive gives."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError, pressed_only_words
from softdyn.kernels import Kernel
from softdyn.scene.pair_drive import Drive
from softdyn.scene.pair_scene import Scene

Array = NDArray[np.float64]
EPS = float(np.finfo(float).eps)


def drive_at(kernel: Kernel, drive: Drive, t: Array) -> tuple[Array, Array]:
    """What the drive gives, and its rate of change, at the times t.

    Parameters
    ----------
    kernel : Kernel
    drive : Drive
    t : array, shape (times,)
    """
    value, rate = np.empty(len(t)), np.empty(len(t))
    kernel.functions.drive(len(t), t, *drive.arguments, value, rate)
    return value, rate


def deflection(kernel: Kernel, h: Array, F: Array, p: Array) -> Array:
    """Deflection at each gap under each force (eq. 1); nan where there is none.

    Parameters
    ----------
    kernel : Kernel
    h : array, shape (n,)
        Gaps, lengths.
    F : array, shape (n,)
        Forces.
    p : array, shape (parameters,)
    """
    delta = np.full(len(h), math.nan)
    kernel.functions.solve_delta(len(h), h, F, p, delta)
    return delta


def evaluate(kernel: Kernel, h: Array, delta: Array, inputs: Mapping[str, Array], p: Array) -> dict[str, Array]:
    """Return the kernel's outputs at each state; ``inputs`` are F and dF_dt, or the given velocity, dX_dt.

    Parameters
    ----------
    kernel : Kernel
    h : array, shape (n,)
        Gaps, lengths.
    delta : array, shape (n,)
        Deflections, lengths.
    inputs : mapping from str to array, shape (n,)
        What the kernel takes besides.
    p : array, shape (parameters,)
    """
    out = np.empty(len(kernel.outputs) * len(h))
    kernel.functions.evaluate(len(h), h, delta, *(inputs[name] for name in kernel.inputs), p, out)
    return dict(zip(kernel.outputs, out.reshape(len(kernel.outputs), len(h)), strict=True))


def initial_deflection(scene: Scene, kernel: Kernel, drive: Drive, p: Array, R: float) -> float:
    """Deflection at the start: of the force given, else of what fixes it (X, delta, the position, the spring).

    Parameters
    ----------
    scene : Scene
    kernel : Kernel
    drive : Drive
    p : array, shape (parameters,)
    R : float
        Radius of the particles, a length.

    Raises
    ------
    SceneError
        If there is none, or if what is given contradicts itself.
    """
    h = 0.0 if kernel.dry else float(scene.h)
    given = float(drive_at(kernel, drive, np.array([drive.start]))[0][0])
    if not math.isfinite(given):
        raise SceneError(f"[drive] {drive.control} has no finite value at the start: {given}")
    if drive.control == "force":
        delta = float(deflection(kernel, np.array([h]), np.array([given]), p)[0])
        if not math.isfinite(delta):
            why = f": {pressed_only_words(kernel.law)}" if kernel.pressed_only and given < 0 else ""
            raise SceneError(f"no deflection balances the initial force F={given:g} at h={h:g}{why}")
        cause = f"the initial force F = {given:g}"
    elif drive.control == "position":
        delta = _known(scene, (2 * R + h - given) / 2, R, f"[drive] position, {given:.15g} at the start,")
        cause = f"the initial position {given:.15g}"
    elif drive.control == "spring":
        balance = _balance_of_spring(kernel, p, h, drive.stiffness, 2 * R + h - given, R)
        # the spring's own deflection carries the rounding of X - base; a delta given with it does not
        delta = _known(scene, balance, R, f"[drive] spring, its base at {given:.15g} at the start,")
        cause = f"the spring, its base at {given:.15g},"
    elif scene.delta is not None or scene.X is None:
        delta, cause = float(scene.delta or 0.0), f"delta = {scene.delta or 0.0:g}"
    else:
        delta, cause = (2 * R + h - float(scene.X)) / 2, "X"
    if scene.X is not None:
        by_X = (2 * R + h - float(scene.X)) / 2
        # X determines delta up to the rounding of the difference that it is (eq. 2)
        if abs(by_X - delta) > 1e-6 * abs(delta) + 8 * EPS * (2 * R + h):
            raise SceneError(
                f"[pair] X = {scene.X:.15g} contradicts h = {h:g} and {cause}: they make "
                f"delta = {delta:.6g} and X = {2 * R + h - 2 * delta:.15g}, while X and h make delta = {by_X:.6g}; "
                "leave X out, or change the " + drive.control
            )
    return delta


def _known(scene: Scene, found: float, R: float, what: str) -> float:
    """The deflection found, or the one given where the two agree to the rounding of a difference of lengths."""
    if scene.delta is None:
        return found
    if abs(float(scene.delta) - found) > 1e-6 * abs(found) + 8 * EPS * (2 * R + float(scene.h)):
        raise SceneError(f"[pair] delta = {scene.delta:g} contradicts {what} which makes it {found:.6g}; leave one out")
    return float(scene.delta)


def _balance_of_spring(kernel: Kernel, p: Array, h: float, stiffness: float, stretch: float, R: float) -> float:
    """Deflection at which F_ela = stiffness (stretch - 2 delta): Newton's iteration between bounds that shrink."""

    def at_deflection(delta: float) -> tuple[float, float]:
        at = evaluate(kernel, np.array([h]), np.array([delta]), {"dX_dt": np.zeros(1)}, p)
        return float(at["F_ela"][0]) + stiffness * (2 * delta - stretch), float(at["C"][0])

    low, high = sorted((0.0, stretch / 2))
    # a force at delta = 0 may bring the balance beyond either
    low = next((x for x in (low, -R) if at_deflection(x)[0] <= 0), low)
    high = next((x for x in (high, R) if at_deflection(x)[0] >= 0), high)
    delta = min(max(0.0, low), high)
    for _ in range(400):
        residual, stiffness_of_contact = at_deflection(delta)
        low, high = (low, delta) if residual > 0 else (delta, high)
        step = residual / (2 * stiffness_of_contact + 2 * stiffness)
        if abs(step) <= EPS * abs(delta):
            return delta
        trial = delta - step
        delta = trial if low < trial < high else (low + high) / 2
        if delta in (low, high):
            return delta
    raise SceneError(f"no deflection balances the spring at the start, h={h:g}")
