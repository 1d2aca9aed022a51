"""Parameters of the law as a kernel takes them: one value of each, or one for each contact, mixed from two species.

In come a checked scene and, once it is known which parameters vary, their kernel; out go arrays in the kernel's order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import product
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.laws import law_of
from softdyn.particles.geometry import Integers
from softdyn.particles.names import is_number, listed
from softdyn.scene.numbers import Range, range_fault
from softdyn.traits import traits_of
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.particles.system import ValidatedScene

Array = NDArray[np.float64]

#: Of the single drags, the part that a scene leaves out: a parameter of kernels with drag.
UNDRAGGED = "undragged_p1"
#: What does not stand among a scene's parameters.
FROM_SCENE = ("R", "size_ratio", UNDRAGGED)

#: Largest part of a force at delta = 0 that may be left of it where contacts fade.
LEFT_AT_REST = 1e-9

MIXING: dict[str, Callable[[Array, Array], Array]] = {
    "arithmetic": lambda one, other: (one + other) / 2,
    "geometric": lambda one, other: np.sqrt(one * other),
    "harmonic": lambda one, other: 2 * one * other / (one + other),
}


class TakesParameters(Protocol):
    """What is known of a kernel's parameters: which are uniform, which vary, which values they may have."""

    @property
    def uniform(self) -> tuple[str, ...]: ...
    @property
    def varying(self) -> tuple[str, ...]: ...
    @property
    def positive(self) -> tuple[str, ...]: ...
    @property
    def ranges(self) -> Mapping[str, Range]: ...


def varying_parameters(facts: ValidatedScene) -> tuple[str, ...]:
    """Names of the parameters that differ from contact to contact.

    Raises
    ------
    SceneError
        If a parameter depends on species that there are not, or without a rule of mixing.
    """
    scene = facts.scene
    faults, varying = [], []
    if np.ptp(facts.radii) > 0 or facts.walls:
        varying += ["R", "size_ratio"]
    faults += [
        f"[parameters] {name} follows from the radii of the particles: leave it out"
        for name in ("R", "size_ratio")
        if name in scene.parameters
    ]
    for name, value in scene.parameters.items():
        if not isinstance(value, Mapping):
            if not is_number(value):
                faults.append(f"[parameters] {name} must be a finite number, not {value!r}")
            continue
        if facts.names == ("",):
            faults.append(f"[parameters] {name} depends on the species, and particles have none: [particles] species")
            continue
        unknown = [key for key in value if key not in facts.names]
        missing = [key for key in facts.names if key not in value]
        known = ", ".join(repr(key) for key in facts.names)
        if unknown:
            faults.append(f"[parameters] {name}: unknown species {', '.join(map(repr, unknown))}; there are {known}")
        if missing:
            faults.append(f"[parameters] {name} has no value for species {', '.join(map(repr, missing))}")
        if not all(is_number(number) for number in value.values()):
            faults.append(f"[parameters] {name}: all values must be finite numbers")
        if name == "eta":
            faults.append("[parameters] eta is the fluid's, and cannot depend on the species")
        elif name != "E" and name not in scene.mixing:
            faults.append(
                f"[parameters] {name} depends on the species: say how two of them mix, [mixing] {name} = one of "
                f"{', '.join(MIXING)}"
            )
        varying.append(name)
    if "E" in scene.parameters and "E" not in varying and any(wall.rigid for wall in facts.walls):
        varying.append("E")
    for name, rule in scene.mixing.items():
        if rule not in tuple(MIXING):
            faults.append(f"[mixing] {name}: unknown rule {rule!r}{suggestion(rule, tuple(MIXING))}")
        if name == "eta":
            faults.append("[mixing] eta is the fluid's, which all particles share: leave it out")
        elif name in ("R", "E"):
            faults.append(f"[mixing] {name} is mixed as the physics of two elastic half-spaces asks: leave it out")
        elif not isinstance(scene.parameters.get(name), Mapping):
            faults.append(f"[mixing] {name} does not depend on the species")
    if faults:
        raise SceneError(listed(faults))
    return tuple(varying)


def uniform_values(facts: ValidatedScene, kernel: TakesParameters) -> Array:
    """Values of the uniform parameters, in the kernel's order; checks those that vary, too.

    Raises
    ------
    SceneError
        Listing missing, unknown, non-positive and out-of-range parameters.
    """
    scene, names = facts.scene, (*kernel.uniform, *kernel.varying)
    given = {**scene.parameters}
    faults = [
        f"[parameters] {name!r} is not a parameter of the law{suggestion(name, [n for n in names if n != 'R'])}"
        for name in given
        if (name not in names or name in FROM_SCENE) and not (name == "eta" and scene.drag)
    ]
    for name in names:
        if name in FROM_SCENE:
            continue
        if name not in given:
            faults.append(f"[parameters] {name} is missing")
            continue
        value = given[name]
        for number in value.values() if isinstance(value, Mapping) else [value]:
            if name in kernel.ranges and (fault := range_fault(name, number, kernel.ranges[name])):
                faults.append(fault)
            elif name in kernel.positive and not number > 0:
                faults.append(f"[parameters] {name} must be positive, not {number!r}")
    eta = given.get("eta")
    wrong = isinstance(eta, Mapping) or not is_number(eta) or not float(eta or 0) > 0
    if scene.drag and "eta" in names and wrong:
        faults.append("[parameters] eta is missing, and the drag on a particle is 6 pi eta R")
    if faults:
        raise SceneError(listed(faults))
    given |= {"R": float(facts.radii[0]), UNDRAGGED: max(0.0, 1 - float(scene.drag))}
    return np.array([float(given[name]) for name in kernel.uniform])  # type: ignore[arg-type]


def mixed_parameters(facts: ValidatedScene, kernel: TakesParameters, i: Integers, j: Integers) -> Array:
    """Varying parameters of the law for each contact, shape (parameters, n).

    R is 2 R1 R2/(R1 + R2) and E the harmonic mean: derived, for walls too, in :mod:`softdyn.derive.contact_equations`.

    Parameters
    ----------
    facts : ValidatedScene
    kernel : ContactKernel or other
        Whose ``varying`` names the parameters.
    i, j : array of int, shape (n,)
        The particles; a wall w has j = N + w.
    """
    scene, count = facts.scene, len(facts.radii)
    wall = j >= count
    partner = np.where(wall, i, j)
    rigid = np.array([w.rigid for w in facts.walls] or [False])
    hard = np.zeros(len(i), dtype=bool)
    hard[wall] = rigid[j[wall] - count]
    rows = np.empty((len(kernel.varying), len(i)))
    for row, name in zip(rows, kernel.varying, strict=True):
        if name == "R":
            row[:] = MIXING["harmonic"](facts.radii[i], facts.radii[partner])
            row[wall] = 2 * facts.radii[i[wall]]
            continue
        if name == "size_ratio":
            row[:] = facts.radii[i] * facts.radii[partner] / (facts.radii[i] + facts.radii[partner]) ** 2
            row[wall] = 0.0
            continue
        given = scene.parameters[name]
        values = np.array([given[key] for key in facts.names] if isinstance(given, Mapping) else [given], dtype=float)
        of = values[facts.species] if isinstance(given, Mapping) else np.full(count, values[0])
        row[:] = MIXING["harmonic" if name == "E" else scene.mixing.get(name, "arithmetic")](of[i], of[partner])
        if name == "E":
            row[hard] *= 2  # a rigid wall gives in by nothing
    return rows


def require_rest(facts: ValidatedScene) -> None:
    """A contact with a range fades by the sign of delta: there, no force may be left at delta = 0.

    Raises
    ------
    SceneError
        If the law has such a force, and it has not fallen to :data:`LEFT_AT_REST` of its largest at half of the range.
    """
    scene = facts.scene
    if math.isinf(facts.reach) or traits_of(scene.law).anchored:
        return

    from sympy import lambdify

    from softdyn.derive.law import parameters_of
    from softdyn.derive.special import IN_NUMPY
    from softdyn.derive.symbols import R, a, delta, h

    law = law_of(scene.law)
    force = law.F_ela.subs(a, law.a).subs(delta, 0)
    own = [symbol for symbol in parameters_of(law) if symbol != R]
    function = lambdify([R, h, *own], force, [IN_NUMPY, "numpy"])
    values = [scene.parameters[symbol.name] for symbol in own]
    each = [tuple(value.values()) if isinstance(value, Mapping) else (value,) for value in values]
    near, far = facts.reach * np.logspace(-9, np.log10(0.5), 64), facts.reach * np.linspace(0.5, 1, 32)
    for radius, *given in product({float(facts.radii.min()), 2 * float(facts.radii.max())}, *each):
        largest, left = (float(np.max(np.abs(function(radius, gaps, *given)))) for gaps in (near, far))
        if not left <= LEFT_AT_REST * largest:
            raise SceneError(
                f"contacts fade from half of their range on, {facts.reach / 2:g}, and there the law has a force at "
                f"delta = 0, {left / largest:.3g} of its largest: give a larger [contacts] range, or a law whose "
                "force at delta = 0 falls faster with the gap"
            )
