"""The stock scenes of grains in a fluid, held against what is known of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import softdyn
from softdyn.fluid import Boundary, MeshSection
from softdyn.particles.packing import random_packing
from softdyn.scene.stock_scenes import suspension_scenes
from softdyn.suspension import SuspensionResult, SuspensionScene, simulate
from softdyn.suspension.suspension_run import made_ready

pytestmark = pytest.mark.slow

#: What balances close to, over what flows: of grains that have come to rest that is next to nothing.
CLOSED = 1e-10


def run(name: str) -> SuspensionResult:
    scene = softdyn.read_scene(suspension_scenes()[name])
    assert isinstance(scene, SuspensionScene)
    result = simulate(scene)
    kinds = ("mass", "momentum", "volume", "exchange")
    assert all(float(result.arrays[f"{kind}_imbalance"].max()) < CLOSED for kind in kinds)
    assert not result.warnings
    return result


def excess(result: SuspensionResult, area: float) -> np.ndarray:
    """Pressure below less that above, and less the weight of the fluid alone, times the area: of each frame."""
    y = result.p_at[:, 1]
    low, high = np.abs(y) < 1e-9, np.abs(y - y.max()) < 1e-9
    drop = result.p[:, low].mean(axis=1) - result.p[:, high].mean(axis=1)
    return np.asarray((drop - y.max()) * area)


def test_a_depot_rests_on_walls_and_the_fluid_carries_none_of_it() -> None:
    """While grains sink, the pressure carries their weight less buoyancy; at the end the walls do.

    A bed of this stiffness rings for some time, and its last motions are told: speeds below 1e-2 of those of the fall
    leave forces of a hundredth.
    """
    result = run("depot")
    buoyant = 0.6 * -result.grain_weight[-1, 1]
    carried = -sum(result.arrays[f"contact_force_{name}"][:, 1] for name in ("left", "right", "bottom")) / buoyant
    pressure = excess(result, 8.0) / buoyant
    # collisions with the floor are brief: what counts beside the pressure is the mean of all steps since the last frame
    pushed = result.grain_contact[:, 1] / buoyant
    frames = np.searchsorted(result.t, result.step_t - 1e-9)
    falling = np.bincount(frames, pushed) / np.maximum(np.bincount(frames), 1)
    sinking = (result.t >= 2) & (result.t <= 10)
    # walls of the fluid rub, too, and what sinks in the middle rises at the sides
    assert (pressure + falling)[sinking] == pytest.approx(1.0, abs=0.15)
    assert pressure[sinking].min() > 0.6
    assert carried[result.t <= 7] == pytest.approx(0.0, abs=1e-12)
    assert carried[-1] == pytest.approx(1.0, abs=0.01)
    assert pressure[-1] == pytest.approx(0.0, abs=0.01)
    assert np.abs(result.v[-1]).max() < 0.01 * np.abs(result.v).max()
    assert (result.x[-1, :, 1] > 0.9 * result.radii).all()


def test_a_bed_is_fluidised_when_the_pressure_carries_it() -> None:
    """At rest, on the way up through the minimum, above it, and on the way down: the bed comes back looser, later."""
    result = run("fluidised")
    weight = 0.6 * -result.grain_weight[-1, 1]
    drop = excess(result, 16.0) / weight
    floor = -result.contact_force_bottom[:, 1] / weight
    rest, above = (result.t > 13) & (result.t < 19), (result.t > 44) & (result.t < 55)
    assert drop[rest] == pytest.approx(0.0, abs=0.02)
    assert floor[rest] == pytest.approx(1.0, abs=0.02)
    assert drop[above] == pytest.approx(1.0, abs=0.02)
    assert floor[above] == pytest.approx(0.0, abs=0.02)
    below = (result.t > 21) & (result.t < 40)
    assert (np.diff(drop[below]) > 0).all()
    height = 2 * result.x[:, :, 1].mean(axis=1)
    up, down = np.searchsorted(result.t, (40.0, 80.0))
    assert height[down] > 1.1 * height[up]


def ball(count: int, middle: float) -> np.ndarray:
    """Places spread evenly over a ball of the radius 1 (the roots of 2, 3 and 5 are not commensurable)."""
    k = np.arange(1, 4 * count)[:, None]
    places = 2 * ((k * np.sqrt([2.0, 3.0, 5.0])) % 1) - 1
    return np.asarray(places[np.sum(places**2, axis=1) < 1][:count] + middle)


def speed_of_ball(cells: int, count: int) -> tuple[float, float]:
    """Mean speed of spheres in a ball of the radius 1, in a box of side 3 whose walls slip; and that of one alone.

    They fill 0.05 of it, whatever their number, and their weight less buoyancy is 1 per volume.
    """
    radius = (0.05 / count) ** (1 / 3)
    scene = SuspensionScene(
        viscosity=1.0, density=1e-3, elements="P1-P1", mesh=MeshSection(box=[3.0] * 3, cells=[cells] * 3),
        boundary=[Boundary(["left", "right", "bottom", "top", "front", "back"], slip=True)], gravity=[0.0, -1.0, 0.0],
        positions=ball(count, 1.5), radii=radius, grain_density=1.001, drag="stokes", width=0.3, until_t=1.0, dt=0.5,
        times=2,
    )  # fmt: skip
    return -float(simulate(scene).v[-1, :, 1].mean()), 2 / 9 * radius**2


def speed_of_drop(width: float) -> float:
    """Speed of a ball of the force 1 in that box: a sum over waves, whose forces and speeds the filter has spread."""
    m = np.arange(0, 40)
    x, y, z = np.meshgrid(m, m[1:], m, indexing="ij")
    k2 = (np.pi / 3) ** 2 * (x**2 + y**2 + z**2)
    k = np.sqrt(k2)
    form = 3 * (np.sin(k) - k * np.cos(k)) / k**3
    modes = (2.0 - (x == 0)) * 2.0 * (2.0 - (z == 0)) / 27
    modes = modes * (np.cos(np.pi * x / 2) * np.sin(np.pi * y / 2) * np.cos(np.pi * z / 2)) ** 2
    wide = (1 + width**2 / 4 * k2) ** -4.0
    return float(np.sum(modes * (np.pi / 3) ** 2 * (x**2 + z**2) / k2**2 * form**2 * wide))


def test_a_cloud_falls_as_a_drop_of_a_heavier_fluid() -> None:
    """As Hadamard's and Rybczynski's drop of the same viscosity, with a slip of its spheres, that of one alone.

    The reference has the box and the width of the filter, which is 1 and 1.6 cells. What the mesh leaves, of second
    order, falls faster than the width of its cells, and does not depend on how many spheres there are.
    """
    force = 0.05 * 4 / 3 * math.pi
    expected = force * speed_of_drop(0.3)
    errors = {}
    for cells, count in ((10, 400), (10, 1600), (16, 400)):
        found, alone = speed_of_ball(cells, count)
        errors[cells, count] = 1 - found / (expected + alone)
    assert 0 < errors[16, 400] < 10 / 16 * errors[10, 400] < 0.15
    assert errors[10, 1600] == pytest.approx(errors[10, 400], abs=0.03)


def test_settling_is_hindered_as_its_closure_says() -> None:
    """At phi = 0.3, in a column with a floor and a lid: n of Richardson and Zaki is that of Di Felice, 4.8, within 0.2.

    Grains in the middle half, of which the volume that comes down is replaced by fluid. At the Reynolds number 0 the
    closure is 0.96 of Stokes' drag over c^2.8, and the pressure is that of the mixture. So is the viscosity: else parts
    with more grains sink through the rest as through a clear fluid.
    """
    x, _, lengths = random_packing(count=124, dimension=3, fraction=0.3, seed=2, radii=[0.5])
    side = float(lengths[0])
    places = np.concatenate([x, x + np.array([0.0, side, 0.0])])
    places[:, 1] = np.clip(places[:, 1], 0.3, 2 * side - 0.3)
    scene = SuspensionScene(
        viscosity=1.0, density=0.01, elements="P1-P1", mesh=MeshSection(box=[side, 2 * side, side], cells=[6, 12, 6]),
        boundary=[
            Boundary(["left", "right"], periodic=True), Boundary(["front", "back"], periodic=True),
            Boundary(["bottom", "top"], velocity=[0.0] * 3),
        ],
        gravity=[0.0, -1.0, 0.0], positions=places, radii=0.5, grain_density=1.01, drag="dallavalle_di_felice",
        mixture="batchelor", parameters={"B": 6.2}, width=1.5, until_t=0.6, dt=0.1, times=2,
    )  # fmt: skip
    result = simulate(scene)
    middle = np.abs(places[:, 1] - side) < side / 2
    speed = -18 * 0.96 * result.v[-1, middle, 1].mean()
    assert math.log(speed) / math.log(0.7) == pytest.approx(4.8, abs=0.2)


def test_a_bed_of_real_grains_has_the_pressure_drop_of_its_closure() -> None:
    """Stokes flow through 100 spheres that are held in a periodic box, at phi = 0.6: the flux within 2 %.

    What grains make of the porosity about them varies, and the drag is more than linear in it.
    """
    x, _, lengths = random_packing(count=100, dimension=3, fraction=0.6, seed=1, radii=[0.5])
    side, phi = float(lengths[0]), 0.6
    pairs = (["left", "right"], ["bottom", "top"], ["front", "back"])
    scene = SuspensionScene(
        viscosity=1.0, elements="P1-P1", mesh=MeshSection(box=[side] * 3, cells=[5] * 3), force=[1.0, 0.0, 0.0],
        boundary=[Boundary(pair, periodic=True) for pair in pairs], until_t=1.0, dt=1.0, times=2, positions=x,
        radii=0.5, held=True, drag="ergun", width=1.5,
    )  # fmt: skip
    result = simulate(scene)
    flux = float((made_ready(scene).maps.moments @ result.u[-1]).sum(axis=0)[0]) / side**3
    assert 100 * math.pi / 6 / side**3 == pytest.approx(phi, rel=1e-12)
    assert flux == pytest.approx((1 - phi) ** 3 / (150 * phi**2), rel=0.02)


def clear_volume(result: SuspensionResult, phi: float) -> np.ndarray:
    """Volume with less than half of a fraction of grains, of each frame."""
    edges = result.at[result.corners]
    volumes = np.abs(np.linalg.det(edges[:, 1:] - edges[:, :1])) / 6
    return np.array([float(volumes @ np.mean((1 - c[result.u_nodes]) < phi / 2, axis=1)) for c in result.c])


def test_a_suspension_clears_faster_where_its_walls_lean() -> None:
    """By the area on which grains come down, seen from above (Ponder 1925; Nakamura and Kuroda 1937): within 10 %.

    What is left of the suspension is along so much less of the wall. Upright, it clears at the hindered speed of its
    closure, Re = 0: 0.96 of Stokes' drag over c^2.8, and the pressure of the mixture.
    """
    scene = softdyn.read_scene(suspension_scenes()["boycott"])
    assert isinstance(scene, SuspensionScene)
    assert scene.mesh.box is not None
    width, length, depth = scene.mesh.box
    found = []
    for gravity in (scene.gravity, [0.0, -18.0, 0.0]):
        result = simulate(replace(scene, gravity=gravity, until_t=10.0, times=11))
        clear = clear_volume(result, 0.1) / (width * length * depth)
        found.append(clear - clear[0])  # next to walls there are no centres of grains
    leaning, upright = found
    speed = float(np.polyfit(result.t[3:], upright[3:], 1)[0]) * length
    assert speed == pytest.approx(0.9**4.8 / 0.96, rel=0.1)
    across, along = width * math.cos(math.radians(30)), length * math.sin(math.radians(30))
    area = across + along * (1 - leaning[3])
    expected = area / along * (1 - math.exp(-speed * along / (width * length) * 5))
    assert leaning[8] - leaning[3] == pytest.approx(expected, rel=0.1)
    assert leaning[8] - leaning[3] > 2.4 * (upright[8] - upright[3])


def speed_of_wave(k: float, high: float, upper: float, force: float) -> float:
    """Speed over height of a wave between two layers of fluid, the lower of viscosity 1, between walls: Stokes flow.

    The velocity across is a sum of cosh, sinh, y cosh, y sinh of k y in each; it, the velocity along and both stresses
    go on from one to the other, but for the weight of the wave, a force per volume times its height.
    """

    def slopes(y: float) -> list[np.ndarray]:
        c, s = math.cosh(k * y), math.sinh(k * y)
        return [
            np.array([c, s, y * c, y * s]),
            np.array([k * s, k * c, c + k * y * s, s + k * y * c]),
            np.array([k**2 * c, k**2 * s, 2 * k * s + k**2 * y * c, 2 * k * c + k**2 * y * s]),
            np.array([k**3 * s, k**3 * c, 3 * k**2 * c + k**3 * y * s, 3 * k**2 * s + k**3 * y * c]),
        ]

    matrix, right = np.zeros((8, 8)), np.zeros(8)
    for row, part, y in ((0, slice(0, 4), high), (2, slice(4, 8), -high)):
        matrix[row, part], matrix[row + 1, part] = slopes(y)[:2]
    w, first, second, third = slopes(0.0)
    for part, eta, sign in ((slice(0, 4), upper, 1), (slice(4, 8), 1.0, -1)):
        matrix[4, part], matrix[5, part] = sign * w, sign * first
        matrix[6, part] = sign * eta * (second + k**2 * w)
        matrix[7, part] = sign * eta * (3 * first - third / k**2)
    right[7] = -force
    return float(w @ np.linalg.solve(matrix, right)[:4])


def test_a_wave_below_a_suspension_grows_as_one_of_a_heavier_more_viscous_fluid() -> None:
    """Two layers with the density and viscosity of the mixture, and of the fluid: the speed of a wave within 10 %.

    The force of the grains is spread by the filter, and so is that of the wave; its own speed, by which it grows, comes
    back through the filter once more. That it is a twelfth of its length high, to begin with, slows its growth.
    """
    scene = softdyn.read_scene(suspension_scenes()["rayleigh_taylor"])
    assert isinstance(scene, SuspensionScene)
    result = simulate(replace(scene, until_t=0.4, times=5))
    wide, high, deep = scene.mesh.box
    k, height, length = 2 * math.pi / wide, 2.0, scene.width / 2
    phi = len(result.radii) * math.pi / 6 / (wide * (high / 2 - 0.3) * deep)
    sharp = speed_of_wave(k, high / 2, 1 + 2.5 * phi + 6.2 * phi**2, 18 * phi)
    assert speed_of_wave(k, 1e2 / k, 1.0, 18 * phi) == pytest.approx(18 * phi / (4 * k), rel=1e-6)

    def across(times: int) -> float:
        """Part of a sharp wave's flow that is left where the force is spread so many times."""
        power = -2 * times
        spread, _ = quad(lambda q: (k**2 + q**2) ** -2 * (1 + length**2 * (k**2 + q**2)) ** power, 0, math.inf)
        return float(spread / quad(lambda q: (k**2 + q**2) ** -2, 0, math.inf)[0])

    middle = np.abs(result.u_at[:, 1] - high / 2) < 1e-9
    along = 2 * np.cos(k * result.u_at[middle, 0])
    speeds = np.mean((result.u + result.us)[1:, middle, 1] * along, axis=1)
    rate, start = np.polyfit(result.t[1:], np.log(speeds), 1)
    assert math.exp(start) / height == pytest.approx(sharp * across(1), rel=0.1)
    assert 0.8 < rate / (sharp * across(2)) < 1
