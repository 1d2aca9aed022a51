"""Imposed stress: a periodic box shears or stretches as it must for components of the stress to be as given.

The edges of a periodic box move with the velocity gradient G of the background flow u = G x. Of G, the shear rate G_xy
may be unknown, or the rate G_aa at which the box stretches along an axis, or along all axes at one rate: each for a
component of the stress that is imposed, shear stress, axial stress, or minus the pressure. At each stage of a step, one
equation for each unknown rate g_k says that the stress is as imposed::

    sigma_k + 2 eta D_k = imposed_k(t) ,    sigma_k = -(1/V) sum over contacts of (F/r) rho . E_k rho ,    rho = r n ,

with the symmetric part D of G; E_xy = e_x e_y^T, E_aa = e_a e_a^T, for the pressure E = 1/d. The second term is what
the fluid resists: a box needs a resistance of its own, lest it jump where the imposed stress does. The power of the
imposed stress, V (imposed_k - 2 eta D_k) g_k, is that of the box and the flow in the balance of energy.

The extra rows and columns of Newton's matrix, with the particles' block K, follow by differentiation. In a stage of
length s the cell A changes by dA/dg_k = s G_k A with the velocity gradient G_k of a unit rate, so that rho changes by
p_k = s G_k A shift for contacts through the faces of the box. At fixed positions, with n from i to j::

    C_ik = sum over contacts of i of [F_r n n^T + (F/r) (1 - n n^T)] p_k - Z_i G_k x_i ,    C_jk the opposite sum

and, along the balance of forces, K dx/dg_k = -C_k. With ::

    w_j = d sigma_j/d rho = -(1/V) [ (F/r)_r (rho . E_j rho) n + (F/r) (E_j + E_j^T) rho ]

the particles are eliminated, and one row and one column are left for each imposed component::

    S_jk = sum over contacts of w_j . (p_k + dx_j/dg_k - dx_i/dg_k) - s sigma_j tr G_k + eta (E_j + E_j^T) : G_k

The particles' balance is solved at each trial of g, which S leads; Broyden's corrections mend what S leaves out: that
K is kept over several iterations, terms of order s^2 where the box shears and stretches at once, and what tangential
forces have in it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.particles import linear
from softdyn.particles.driven import Driven, given_function
from softdyn.particles.energy import power_of_box
from softdyn.particles.force_balance import Balance, Newton, StepFailed
from softdyn.particles.geometry import Box, Contacts, lattice
from softdyn.particles.mechanisms import Mechanism
from softdyn.particles.names import AXES, is_number, listed
from softdyn.particles.surroundings import placed
from softdyn.particles.system import System
from softdyn.particles.time_functions import is_driven
from softdyn.words import suggestion

if TYPE_CHECKING:
    from softdyn.particles.energy import Rates
    from softdyn.particles.resolve import Sensitivity
    from softdyn.particles.system import ValidatedScene
    from softdyn.particles.time_functions import TimeFunction

Array = NDArray[np.float64]

MOST_TRIALS = 20
#: The lengths of a box change by less than this, as a logarithm, in one trial.
LONGEST_TRIAL = 0.1


@dataclass(frozen=True)
class ImposedStress(Mechanism):
    """Components of the stress that are imposed on the box.

    Attributes
    ----------
    names : tuple of str
        "xy", "xx", "yy", "zz", or "pressure".
    stress : Driven
        Their values, > 0 in tension; for the pressure, minus it; shape (names, 1).
    viscosity : float
        Of the fluid: resists the box.
    gradients : array, shape (names, d, d)
        Velocity gradient of a unit rate of each.
    keeps_shape : bool
        Whether all lengths of the box change alike.
    """

    names: tuple[str, ...]
    stress: Driven
    viscosity: float
    gradients: Array
    keeps_shape: bool

    gives = ("box",)
    leads = True
    moves_box = True

    @property
    def weights(self) -> Array:
        """E of each: what of the stress tensor it is, shape (names, d, d)."""
        scale = [self.gradients.shape[1] if name == "pressure" else 1 for name in self.names]
        return np.asarray(self.gradients / np.array(scale, float)[:, None, None])

    def values(self, t: float) -> Array:
        """Values at a time."""
        return self.stress(t)[:, 0]

    def driven(self) -> Iterator[tuple[TimeFunction, Callable[[Sensitivity, float], float]]]:
        """Of a stress, the strain is missed for which the fluid lets it through."""
        for _, _, function in self.stress.changing():
            yield function, lambda to, dt: to.of_strain(dt) / self.viscosity

    def gradient(self, t: float, rates: Array) -> Array:
        """See :class:`Mechanism`."""
        return np.asarray(np.tensordot(rates, self.gradients, 1))

    def box_rates(self, box: Box) -> Array:
        """The unknown rates, as a box has them."""
        G = box.gradient
        places = ["xx" if name == "pressure" else name for name in self.names]
        return np.array([G["xyz".index(place[0]), "xyz".index(place[1])] for place in places])

    def box_with(self, box: Box, z_rate: Array) -> Box:
        """A box with the rates that its coordinates have."""
        d = len(box.lengths)
        stretch = z_rate[:d] if z_rate[:d].any() else None
        if "xy" not in self.names:
            return replace(box, stretch=stretch)  # its shear rate is given
        shear_rate = float(z_rate[d] * box.lengths[0] / box.lengths[1]) if d > 1 else 0.0
        return replace(box, shear_rate=shear_rate, stretch=stretch)

    def powers(self, system: System, contacts: Contacts, at: Balance, rates: Rates) -> dict[str, float]:
        """What moves the box exerts the forces of the contacts through its faces."""
        G = np.tensordot(self.box_rates(system.box), self.gradients, 1)
        return {"box": power_of_box(system, contacts, at, G)}

    def stats(self) -> dict[str, Any]:
        """See :class:`Mechanism`."""
        return {"viscosity": self.viscosity}

    def lead(
        self,
        system: System,
        contacts: Contacts,
        newton: Newton,
        t: float,
        s: float,
        z_star: Array,
        rates: Array,
        solve: Callable[[System, Array], Balance],
        x: Array,
    ) -> tuple[Balance, System, Array, Array]:
        """Balance of all forces at the rates of the box for which the stress is as imposed.

        Parameters
        ----------
        system, contacts, newton, t, s, z_star
            See :func:`softdyn.particles.surroundings.placed`.
        rates : array, shape (names,)
            A guess, 1/time.
        solve : function of a System and positions
            Balances the particles' forces in a given box, from a guess of the positions.
        x : array, shape (N, d + rotations)
            A guess.

        Returns
        -------
        Balance, System, array, array
            Found there; with box and walls; dz/dt; the rates.

        Raises
        ------
        StepFailed
            If no rates are found.
        """
        here, z_rate = placed(system, t, s, z_star, rates)
        found = solve(here, x)
        wrong = excess(self, here, contacts, found, t)
        S, moved = condensed(self, here, contacts, newton, found, s)
        for _ in range(MOST_TRIALS):
            off = _relative(self, here, found, wrong, t)
            if off <= 10 * system.force_tolerance:
                return replace(found, residual=max(found.residual, off)), here, z_rate, rates
            try:
                change = -np.linalg.solve(S, wrong)
            except np.linalg.LinAlgError:
                break
            size = float(np.abs(change).max()) * s
            if not math.isfinite(size):
                break
            change *= min(1.0, LONGEST_TRIAL / size) if size > 0 else 1.0
            rates = rates + change
            here, z_rate = placed(system, t, s, z_star, rates)
            found = solve(here, found.x + np.tensordot(change, moved, 1))
            before, wrong = wrong, excess(self, here, contacts, found, t)
            largest = float(np.abs(change).max())
            if largest > 0:
                along = change / largest  # whose square is no underflow
                S = S + np.outer((wrong - before - S @ change) / largest, along) / float(along @ along)
        raise StepFailed(
            f"no rate of the box keeps the imposed stress at t={t:.6g}: it is off by {float(np.abs(wrong).max()):.3g}; "
            "is it a shear stress beyond what the packing bears, or a pressure below 0?"
        )


def check(facts: ValidatedScene, faults: list[str]) -> ImposedStress | None:
    """Stress imposed on the box of a scene.

    Raises
    ------
    SceneError
        If a component is no function of time.
    """
    scene, box, d = facts.scene, facts.box, facts.x.shape[1]
    given = dict[str, Any](scene.stress)
    if not given:
        faults.append("[stress] viscosity resists a box whose stress is imposed, and none is")
        return None
    known = [*(["xy"] if d > 1 else []), *(2 * axis for axis in AXES[:d]), "pressure"]
    found = [
        f"[stress] unknown component {name!r}{suggestion(name, known)}" for name in scene.stress if name not in known
    ]
    if not box.periodic.all():
        found.append("[stress] a stress is imposed on a box that is periodic along all axes: give its lengths")
    if "xy" in scene.stress and (is_driven(scene.shear_rate) or scene.shear_rate):
        found.append(
            "[stress] xy and [flow] shear_rate: the shear rate follows from the shear stress; give one of them"
        )
    if "pressure" in scene.stress and any(2 * axis in scene.stress for axis in AXES):
        found.append("[stress] pressure and the stress along an axis: give either")
    if scene.wall or scene.hold:
        found.append("[stress] walls and held particles do not move with a box whose stress is imposed: leave them out")
    viscosity = scene.stress_viscosity if scene.stress_viscosity is not None else scene.parameters.get("eta")
    if isinstance(viscosity, Mapping) or not is_number(viscosity) or not viscosity > 0:  # type: ignore[operator]
        found.append("[stress] viscosity, or the parameter eta, must be a positive number: it resists the box")
    if found:
        raise SceneError(listed(found))
    names = tuple(name for name in known if name in scene.stress)
    terms = [(np.array([k]), 0, given_function(scene, given[name], f"[stress] {name}")) for k, name in enumerate(names)]
    signs = np.array([[-1.0 if name == "pressure" else 1.0] for name in names])
    gradients = np.zeros((len(names), d, d))
    for gradient, name in zip(gradients, names, strict=True):
        if name == "pressure":
            gradient[:] = np.eye(d)
        else:
            gradient["xyz".index(name[0]), "xyz".index(name[1])] = 1.0
    return ImposedStress(names, Driven(terms, signs), float(viscosity), gradients, names == ("pressure",))  # type: ignore


def stress_of(system: System, contacts: Contacts, at: Balance) -> Array:
    """Stress of the contacts of a box, shape (d, d), > 0 in tension; the fluid's is not in it.

    The symmetric part, which does the work: where drag resists rotations, there is another.

    Parameters
    ----------
    system : System
    contacts : Contacts
    at : Balance
    """
    stress: Array = np.einsum("c,ca,cb->ab", at.F * at.r, at.n, at.n)
    if at.T is not None:
        sheared = np.einsum("c,ca,cb->ab", at.r, at.T, at.n)
        stress += (sheared + sheared.T) / 2
    return -stress / system.box.volume


def fluid_stress(box: Box, viscosity: float) -> Array:
    """Stress 2 eta D of the fluid, shape (d, d)."""
    return viscosity * (box.gradient + box.gradient.T)


def excess(imposed: ImposedStress, system: System, contacts: Contacts, at: Balance, t: float) -> Array:
    """By how much the imposed components exceed what is imposed.

    Parameters
    ----------
    imposed : ImposedStress
    system : System
        With the box at the end of the stage, which ``at`` is of.
    contacts : Contacts
    at : Balance
    t : float
    """
    total = stress_of(system, contacts, at) + fluid_stress(system.box, imposed.viscosity)
    if "inertia" in at.notes:
        d = system.dimension
        for mechanism in system.having["flux"]:
            total -= mechanism.flux(system, at.x[:, :d], at.notes["inertia"][:, :d]) / system.box.volume
    return np.asarray(np.einsum("kab,ab->k", imposed.weights, total) - imposed.values(t))


def _relative(imposed: ImposedStress, system: System, at: Balance, wrong: Array, t: float) -> float:
    """Size of an excess, relative to all that makes a stress."""
    scale = float(np.abs(at.F * at.r).sum()) / system.box.volume
    scale += float(np.abs(imposed.values(t)).max()) + float(np.abs(fluid_stress(system.box, imposed.viscosity)).max())
    return float(np.abs(wrong).max()) / scale if scale > 0 else 0.0


def condensed(
    imposed: ImposedStress, system: System, contacts: Contacts, newton: Newton, at: Balance, s: float
) -> tuple[Array, Array]:
    """Derivatives of the stress by the unknown rates, forces in balance: S and dx/dg.

    Of the shapes (names, names) and (names, N, d + rotations).

    Parameters
    ----------
    imposed : ImposedStress
    system : System
        With the box at the end of the stage, which ``at`` is of.
    contacts : Contacts
    newton : Newton
        With the matrix of the balance; without one nothing moves with the box.
    at : Balance
    s : float
        gamma dt of the stage.
    """
    d = len(system.box.lengths)
    G, E = imposed.gradients, imposed.weights
    volume = system.box.volume
    rho, slope = at.n * at.r[:, None], at.F / at.r
    images = contacts.shift @ lattice(system.box, system.box.since).T
    pushed = s * np.einsum("kab,cb->kca", G, images)
    along = np.einsum("kca,ca->kc", pushed, at.n)
    # change of F n, with the force that a pair exerts on i
    changed = at.F_r * along
    force = changed[:, :, None] * at.n + slope[:, None] * (pushed - along[:, :, None] * at.n)
    moved = np.zeros((len(G), *at.x.shape))
    for k in range(len(G)):
        column = np.zeros_like(at.x)
        np.add.at(column[:, :d], contacts.i, force[k])
        np.add.at(column[:, :d], contacts.j, -force[k])
        if system.dragged:
            column[:, :d] -= system.resistance[:, :d] * (at.x[:, :d] @ G[k].T)
            if at.x.shape[1] > d:  # rotations follow the flow's, -g/2
                column[:, -1] += system.resistance[:, -1] * G[k, 0, 1] / 2 * system.radii
        column[system.fixed] = 0.0
        if newton.solver is not None and newton.solver.matrix is not None:
            moved[k] = -linear.solve(newton.solver, column)
    curved = (at.F_r - slope) / at.r
    square = np.einsum("ca,jab,cb->jc", rho, E, rho)
    both = E + E.transpose(0, 2, 1)
    w = -(curved * square)[:, :, None] * at.n - slope[:, None] * np.einsum("jab,cb->jca", both, rho)
    w /= volume
    drho = pushed + moved[:, contacts.j, :d] - moved[:, contacts.i, :d]
    sigma = np.einsum("jab,ab->j", E, stress_of(system, contacts, at))
    S = np.einsum("jca,kca->jk", w, drho) - np.outer(sigma, s * np.trace(G, axis1=1, axis2=2))
    S += imposed.viscosity * np.einsum("jab,kab->jk", both, G)
    return S, moved
