"""What grains and fluid exchange in a step: volume, drag and pressure.

The drag on a grain over a step dt is that at its velocity at the end, v = v* + dt/m (F - V grad p), v* being what its
weight and its contacts make of the velocity before. Solved for F,

    F = K' (<v_f> - v*) + a V <grad p> ,    K' = K/(1 + dt K/m) ,    a = dt K'/m ,

where <> is the filter. The fluid has spread(F) of it. <v_f> is a mean over the filter, whose matrix would be full; so
the flow is solved for with what is local, and with the mean of a flow u_t that is tried, until that is what comes out:

    friction (u - u_t) - pull + lent grad p ,
    friction = spread(K')/c ,  pull = spread(K' (v* - <v_t>)) ,  lent = spread(a V) .

Were the force in each place that of the velocity there, grains would resist each shear over the width of the filter,
as spheres of that size would: a sheared suspension would be much more viscous than its closure says.

As filter and spreading are adjoint, and all integrals exact, forces on grains and on the fluid add up to rounding,
whatever was tried. A grain that is held has an infinite mass.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

from softdyn.errors import IntegrationError
from softdyn.fluid.flow_system import FluidSystem
from softdyn.fluid.mesh import place, volumes
from softdyn.suspension.filter import Filter, gathered, gradients, spread, spread_flux
from softdyn.suspension.undisturbed import DragLaw, frictions

Array = NDArray[np.float64]

#: Porosity that there must be everywhere: closures hold for none below.
LEAST = 0.05


@dataclass(frozen=True)
class Projections:
    """Matrices between the nodes of the fluid and those of the filter.

    Attributes
    ----------
    up : sparse matrix, shape (nodes of the velocity, nodes of the filter)
        Values of a linear field at the nodes of the velocity.
    moments : sparse matrix, shape (nodes of the filter, nodes of the velocity)
        Integrals of a field of the velocity's order times the linear shape functions.
    slopes : tuple of sparse matrices, shape (nodes of the filter, nodes of the filter)
        The same of the derivatives of a linear field along each axis.
    corner : array of int, shape (nodes of the filter,)
        Node of the velocity at each of the filter.
    """

    up: csr_matrix
    moments: csr_matrix
    slopes: tuple[csr_matrix, ...]
    corner: NDArray[np.int64]


def projections(fluid: FluidSystem) -> Projections:
    """Matrices of a fluid; the nodes of the filter are those of the pressure."""
    mesh, velocity, pressure = fluid.mesh, fluid.velocity, fluid.pressure
    d, sizes, n = mesh.dimension, volumes(mesh), velocity.of.shape[1]
    pairs = list(combinations(range(d + 1), 2))
    node = np.concatenate([velocity.of[:, : d + 1].ravel(), *(velocity.of[:, d + 1 + k] for k in range(n - d - 1))])
    one = np.concatenate([pressure.of.ravel(), *(pressure.of[:, i] for i, _ in pairs[: n - d - 1])])
    other = np.concatenate([pressure.of.ravel(), *(pressure.of[:, j] for _, j in pairs[: n - d - 1])])
    _, first = np.unique(node, return_index=True)
    rows = np.repeat(node[first], 2)
    columns = np.stack([one[first], other[first]], axis=1).ravel()
    up = csr_matrix(coo_matrix((np.full(len(rows), 0.5), (rows, columns)), (velocity.count, pressure.count)))
    local = _moments(d, velocity.order)
    moments = _put(sizes[:, None, None] * local, pressure.of, velocity.of, (pressure.count, velocity.count))
    each = sizes[:, None, None] / (d + 1) * gradients(mesh)
    slopes = tuple(
        _put(np.repeat(each[:, None, :, axis], d + 1, axis=1), pressure.of, pressure.of, (pressure.count,) * 2)
        for axis in range(d)
    )
    corner = np.empty(pressure.count, dtype=np.int64)
    corner[pressure.of] = velocity.of[:, : d + 1]
    return Projections(up, moments, slopes, corner)


def _put(local: Array, rows: NDArray[np.int64], columns: NDArray[np.int64], shape: tuple[int, int]) -> csr_matrix:
    i = np.repeat(rows, columns.shape[1], axis=1).ravel()
    j = np.tile(columns, (1, rows.shape[1])).ravel()
    return csr_matrix(coo_matrix((local.ravel(), (i, j)), shape=shape))


def _moments(d: int, order: int) -> Array:
    """Integrals of linear shape functions times those of an order, over the element's volume."""

    def mean(*which: int) -> float:
        powers = [which.count(k) for k in range(d + 1)]
        return factorial(d) * float(np.prod([factorial(p) for p in powers])) / factorial(d + len(which))

    corners = range(d + 1)
    if order == 1:
        return np.array([[mean(i, j) for j in corners] for i in corners])
    return np.array(
        [
            [2 * mean(i, j, j) - mean(i, j) for j in corners] + [4 * mean(i, j, k) for j, k in combinations(corners, 2)]
            for i in corners
        ]
    )


@dataclass(frozen=True)
class Cloud:
    """Grains at the start of a step, and all that the step needs of them.

    Attributes
    ----------
    x, v : arrays, shape (grains, d)
        Places, and velocities before the step.
    aim : array, shape (grains, d)
        Velocities that their weight and contacts would give them by its end.
    ease : array, shape (grains,)
        Length of the step over mass; 0 of grains that are held.
    volume, radii : arrays, shape (grains,)
    weights : sparse matrix
        Of the filter, at their places.
    share : array, shape (nodes of the filter,)
        Their share of the volume.
    """

    x: Array
    v: Array
    aim: Array
    ease: Array
    volume: Array
    radii: Array
    weights: csr_matrix
    share: Array


@dataclass(frozen=True)
class Exchange:
    """Forces on the grains, shape (grains, d) each.

    Attributes
    ----------
    drag, pressure : arrays
        Of the fluid.
    v : array
        Velocities at the end of the step.
    fluid_v : array
        Velocities of the fluid, as the filter tells them.
    """

    drag: Array
    pressure: Array
    v: Array
    fluid_v: Array


def porosity(one: Filter, share: Array, t: float) -> Array:
    """Porosity at the nodes of the filter.

    Parameters
    ----------
    one : Filter
    share : array, shape (nodes,)
        Volume fraction of the grains at the nodes of the filter.
    t : float
        The time, for messages.

    Raises
    ------
    IntegrationError
        Where it is next to nothing, naming the place.
    """
    c = 1 - share
    if not c.min(initial=1.0) >= LEAST:
        k = int(np.argmin(c))
        raise IntegrationError(
            f"grains fill {share[k]:.3g} of the volume at {place(one.nodes.at[k])} at t={t:.6g}, and leave the fluid "
            f"less than {LEAST:g}: give a larger [coupling] width, or contacts that keep them apart"
        )
    return c


def seen(one: Filter, maps: Projections, cloud: Cloud, flux: Array, p: Array) -> tuple[Array, Array]:
    """Velocity of the fluid and gradient of its pressure at the grains, as the filter tells them.

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    flux : array, shape (nodes of the velocity, d)
    p : array, shape (nodes of the filter,)
    """
    v = seen_velocity(one, maps, cloud, flux)
    slope = gathered(one, cloud.weights, np.stack([part @ p for part in maps.slopes], axis=1))
    return v, slope


def seen_velocity(one: Filter, maps: Projections, cloud: Cloud, flux: Array) -> Array:
    """Velocity of the fluid at the grains, as the filter tells it, shape (grains, d).

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    flux : array, shape (nodes of the velocity, d)
    """
    return gathered(one, cloud.weights, (maps.moments @ flux) / (1 - cloud.share)[:, None])


def shear_rates(one: Filter, maps: Projections, cloud: Cloud, flux: Array) -> Array:
    """Shear rate sqrt(2 D:D) of the fluid at each grain, as the filter tells its velocity gradient.

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    flux : array, shape (nodes of the velocity, d)
    """
    v = flux[maps.corner] / (1 - cloud.share)[:, None]
    gradient = gathered(one, cloud.weights, np.stack([part @ v for part in maps.slopes], axis=1))
    both = gradient + gradient.transpose(0, 2, 1)
    return np.asarray(np.sqrt(np.sum(both**2, axis=(1, 2)) / 2))


def shares_at(one: Filter, cloud: Cloud) -> Array:
    """Share of the grains at each, as the filter tells it."""
    return gathered(one, cloud.weights, one.mass * cloud.share)


def drags(law: DragLaw, cloud: Cloud, fluid_v: Array, v: Array, shares: Array) -> tuple[Array, Array]:
    """Friction K of each grain at velocities of both, and its share K' where the step slows the grain down.

    Parameters
    ----------
    law : DragLaw
    cloud : Cloud
        The grains.
    fluid_v, v : array, shape (grains, d)
        Velocities of the fluid at the grains, and of these.
    shares : array, shape (grains,)
        Share of the grains in the volume at each, as the filter tells it.
    """
    relative = np.sqrt(np.sum((fluid_v - v) ** 2, axis=1))
    whole, _ = frictions(law, relative, shares, cloud.volume, cloud.radii)
    return whole, whole / (1 + cloud.ease * whole)


def known_of(one: Filter, maps: Projections, cloud: Cloud, friction: Array, growth: Array) -> dict[str, Array]:
    """What the fluid needs to know of the grains, at the nodes of the velocity, but for what :func:`tried_of` gives.

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    friction : array, shape (grains,)
        K'.
    growth : array, shape (nodes of the filter,)
        dc/dt.
    """
    c = 1 - cloud.share
    lent = cloud.ease * friction * cloud.volume
    fields = spread(one, cloud.weights, np.column_stack([friction, lent]))
    fields[:, 0] /= c
    us = spread_flux(one, cloud.weights, cloud.volume[:, None] * cloud.v)
    up = np.asarray(maps.up @ np.column_stack([c, growth, fields, us]))
    return {"c": up[:, 0], "growth": up[:, 1], "friction": up[:, 2], "lent": up[:, 3], "us": up[:, 4:]}


def tried_of(one: Filter, maps: Projections, cloud: Cloud, friction: Array, flux: Array) -> dict[str, Array]:
    """What more it needs: a flow that is tried, and the pull of grains that feel its mean.

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    friction : array, shape (grains,)
        K'.
    flux : array, shape (nodes of the velocity, d)
        That is tried.
    """
    pull = spread(one, cloud.weights, friction[:, None] * (cloud.aim - seen_velocity(one, maps, cloud, flux)))
    return {"tried": flux, "pull": np.asarray(maps.up @ pull)}


def misfit(one: Filter, maps: Projections, cloud: Cloud, friction: Array, found: Array, tried: Array) -> float:
    """Drag that is not where the grains are, over the drag: 0 where the flow that came out is the one that was tried.

    Parameters
    ----------
    one : Filter
    maps : Projections
    cloud : Cloud
    friction : array, shape (grains,)
        K'.
    found, tried : array, shape (nodes of the velocity, d)
    """
    local = (spread(one, cloud.weights, friction) / (1 - cloud.share))[:, None]
    off = float(np.abs(local * (maps.moments @ (found - tried))).sum())
    size = float(np.abs(local * (maps.moments @ found)).sum() + np.abs(friction[:, None] * cloud.aim).sum())
    return off / size if size else 0.0


def exchanged(one: Filter, maps: Projections, cloud: Cloud, friction: Array, flux: Array, p: Array) -> Exchange:
    """Forces on the grains of a flow that was solved with what :func:`known_of` makes of the friction.

    Parameters
    ----------
    one : Filter
    maps : Projections
        From the fluid's unknowns to the nodes of the filter.
    cloud : Cloud
        The grains.
    friction : array, shape (grains,)
        Of each grain, force over velocity.
    flux : array, shape (nodes of the velocity, d)
        Velocity of the fluid times the porosity.
    p : array, shape (nodes of the filter,)
        Its pressure.
    """
    fluid_v, slope = seen(one, maps, cloud, flux, p)
    pressure = -cloud.volume[:, None] * slope
    drag = friction[:, None] * (fluid_v - cloud.aim) - (cloud.ease * friction)[:, None] * pressure
    return Exchange(drag, pressure, cloud.aim + cloud.ease[:, None] * (drag + pressure), fluid_v)
