"""No result depends on the units in which a scene is given: of length, of time, or of force."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from softdyn.derive import FORCE, LENGTH, PRESSURE, TIME, VISCOSITY
from softdyn.derive.dimensions import DIMENSIONLESS, ENERGY, Dimension
from softdyn.derive.law import dimensions_for
from softdyn.derive.potential import dimensions_for as potential_dimensions
from softdyn.errors import SceneError
from softdyn.laws import find, find_potential, load, load_potential
from softdyn.particles import observables
from softdyn.particles.checkpoint import load as load_checkpoint
from softdyn.particles.files import particle_scene_from
from softdyn.particles.geometry import Wall
from softdyn.particles.packing import random_packing
from softdyn.particles.particle_keys import Hold, ParticleScene, Push
from softdyn.particles.particle_run import prepare, simulate_particles
from softdyn.particles.placing import read_particles
from softdyn.particles.results import ParticleResult, load_particles
from softdyn.particles.until import run_end
from softdyn.scene.stock_scenes import particle_scenes

Array = NDArray[np.float64]
#: Units of length, time and force, in those of a scene as it is written.
Units = tuple[float, float, float]

VELOCITY, RATE, TORQUE = LENGTH / TIME, DIMENSIONLESS / TIME, ENERGY
DENSITY = FORCE * TIME**2 / LENGTH**4


def factor(dimension: Dimension, units: Units) -> float:
    """Number of a quantity in other units, whose number was 1."""
    length, time, force = units
    # mass is force time^2/length
    in_length, in_time = dimension.length - dimension.mass, dimension.time + 2 * dimension.mass
    return float(length ** float(in_length) * time ** float(in_time) * force ** float(dimension.mass))


def scaled(value: Any, dimension: Dimension, units: Units) -> Any:
    """A number, an expression of t, or lists of them in other units."""
    if value is None:
        return None
    if isinstance(value, str):
        text = re.sub(r"\bt\b", f"(t/{units[1]!r})", value)
        return f"({text})*{factor(dimension, units)!r}"
    if isinstance(value, Mapping):
        return {name: scaled(one, dimension, units) for name, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [scaled(one, dimension, units) for one in value]
    return value * factor(dimension, units)


def in_units(scene: ParticleScene, units: Units) -> ParticleScene:
    """The same scene with all its numbers in other units."""
    known = {"eta": VISCOSITY}
    if scene.law is not None:
        known |= {symbol.name: dimension for symbol, dimension in dimensions_for(load(find(scene.law))[0]).items()}

    def of(value: Any, dimension: Dimension) -> Any:
        return scaled(value, dimension, units)

    def of_potential(one: Any) -> Any:
        potential, _ = load_potential(find_potential(one.potential))
        own = {symbol.name: dimension for symbol, dimension in potential_dimensions(potential).items()}
        lengths = {
            name: of(getattr(one, name), LENGTH) for name in ("cut_off", "breaks_at_length") if hasattr(one, name)
        }
        forces = {name: of(getattr(one, name), FORCE) for name in ("breaks_at_force",) if hasattr(one, name)}
        parameters = {name: of(value, own[name]) for name, value in one.parameters.items()}
        return replace(one, parameters=parameters, **lengths, **forces)

    def of_mass(one: Any) -> Any:
        densities = [name for name in ("density", "fluid_density") if getattr(one, name, None) is not None]
        return replace(one, **{name: of(getattr(one, name), DENSITY) for name in densities})

    noise, gravity = scene.noise, scene.gravity

    return replace(
        scene,
        parameters={name: of(value, known[name]) for name, value in scene.parameters.items()},
        positions=of(np.asarray(scene.positions, float), LENGTH),
        radii=of(np.asarray(scene.radii, float), LENGTH),
        box=of(scene.box, LENGTH),
        tilt=of(scene.tilt, LENGTH),
        depth=of(scene.depth, LENGTH),
        gap=of(scene.gap, LENGTH),
        range=of(scene.range, LENGTH),
        shear_rate=of(scene.shear_rate, RATE),
        stress=of(scene.stress, PRESSURE),
        stress_viscosity=of(scene.stress_viscosity, VISCOSITY),
        until_t=of(scene.until_t, TIME),
        step=of(scene.step, TIME),
        velocities=None if scene.velocities is None else of(np.asarray(scene.velocities, float), VELOCITY),
        spins=None if scene.spins is None else of(np.asarray(scene.spins, float), RATE),
        inertia=None if scene.inertia is None else of_mass(scene.inertia),
        gravity=None if gravity is None else of_mass(
            replace(gravity, acceleration=of(gravity.acceleration, VELOCITY / TIME))
        ),
        noise=None if noise is None else replace(
            noise, temperature=of(noise.temperature, ENERGY), step=of(noise.step, TIME)
        ),
        potential=[of_potential(one) for one in scene.potential],
        bond=[of_potential(one) for one in scene.bond],
        push=[
            replace(one, force=of(one.force, FORCE), torque=of(one.torque, TORQUE)) for one in scene.push
        ],
        hold=[replace(one, velocity=of(one.velocity, VELOCITY), spin=of(one.spin, RATE)) for one in scene.hold],
        wall=[
            replace(one, point=of(one.point, LENGTH), velocity=of(one.velocity, VELOCITY)) for one in scene.wall
        ],
    )  # fmt: skip


def distribution(value: tuple[Array, Array]) -> list[Array]:
    return list(value)


#: Every observable, and the dimensions of what it gives.
OBSERVABLES: dict[str, tuple[Callable[[ParticleResult], Any], tuple[Dimension, ...]]] = {
    "is_sheared": (observables.is_sheared, (DIMENSIONLESS,)),
    "is_periodic": (observables.is_periodic, (DIMENSIONLESS,)),
    "has_viscosity": (observables.has_viscosity, (DIMENSIONLESS,)),
    "strain": (observables.strain, (DIMENSIONLESS,)),
    "relative_viscosity": (observables.relative_viscosity, (DIMENSIONLESS,)),
    "normal_stress_differences": (observables.normal_stress_differences, (PRESSURE, PRESSURE)),
    "pressure": (observables.pressure, (PRESSURE,)),
    "wall_forces": (observables.wall_forces, (FORCE,)),
    "rattlers": (observables.rattlers, (DIMENSIONLESS,)),
    "coordination": (observables.coordination, (DIMENSIONLESS,)),
    "fabric": (observables.fabric, (DIMENSIONLESS,)),
    "gap_distribution": (observables.gap_distribution, (LENGTH, DIMENSIONLESS)),
    "force_distribution": (observables.force_distribution, (DIMENSIONLESS, DIMENSIONLESS)),
    "mean_square_displacement": (observables.mean_square_displacement, (LENGTH**2,)),
    "swap_time": (lambda result: observables.swap_time(result, (2, 3), (0, 1)), (TIME,)),
}
#: Dimensions of the result's arrays; those that are not here have none.
ARRAYS = {
    **dict.fromkeys(("t", "step_t", "step_dt"), TIME),
    **dict.fromkeys(("x", "radii", "box", "cell", "depth", "wall_point", "contact_h", "contact_delta"), LENGTH),
    **dict.fromkeys(("contact_F", "contact_T"), FORCE),
    **dict.fromkeys(("gradient", "spin"), RATE),
    "v": VELOCITY,
    "potential_energy": ENERGY,
    "bond_r": LENGTH,
    "bond_tension": FORCE,
    "bond_energy": ENERGY,
}


def told(result: ParticleResult, units: Units = (1.0, 1.0, 1.0)) -> dict[str, Array]:
    """Everything that a result tells, in the units (1, 1, 1), each kind relative to its largest value."""
    found: dict[str, tuple[Any, Dimension]] = {}
    periodic = observables.is_periodic(result)
    for name, values in result.arrays.items():
        if values.dtype.kind in "fiub" and not name.startswith("step_"):
            dimension = ARRAYS.get(name, DIMENSIONLESS)
            dimension = ENERGY if name.startswith("energy_") else dimension
            found[name] = values, (PRESSURE if periodic else ENERGY) if name == "stress" else dimension
    for name, (measure, dimensions) in OBSERVABLES.items():
        try:
            measured = measure(result)
        except (ValueError, IndexError):  # it has none of it
            continue
        measured = measured if isinstance(measured, tuple) else (measured,)
        for number, (one, dimension) in enumerate(zip(measured, dimensions, strict=True)):
            dimension = ENERGY if dimension == PRESSURE and not periodic else dimension
            found[f"{name}()[{number}]"] = one, dimension
    return {name: np.asarray(values, float) / factor(dimension, units) for name, (values, dimension) in found.items()}


def shortened(path: Path) -> ParticleScene:
    """A stock scene, of 40 particles where it has more, over a small part of its time."""
    data = tomllib.loads(path.read_text())
    if "count" in data.get("packing", {}):
        data["packing"]["count"] = min(40, data["packing"]["count"])
    scene = particle_scene_from(data, path.parent)
    return replace(scene, until_t=run_end(scene) / 100, until_strain=None, times=4, rtol=1e-4, target="c")


def column(**changes: Any) -> ParticleScene:
    """Spheres in one dimension, in a periodic box under a pressure."""
    settings: dict[str, Any] = {
        "law": "equal_spheres", "parameters": {"E": 10.0, "eta": 2.0, "nu": 0.4},
        "positions": [[0.5], [2.6], [4.6], [6.7], [8.8], [10.8]], "radii": [1.0, 1.1, 1.0, 1.0, 1.1, 1.0],
        "box": [12.8], "gap": 0.05, "range": 0.4, "drag": 1.0, "stress": {"pressure": "0.01*(1 + 0.1*sin(t))"},
        "until_t": 5.0, "times": 3, "rtol": 1e-5, "target": "c",
    }  # fmt: skip
    return ParticleScene(**{**settings, **changes})


def layer(**changes: Any) -> ParticleScene:
    """Spheres that slide, in two dimensions, under an imposed shear stress."""
    x, radii, box = random_packing(24, 2, 0.8, [1.0, 1.2], 3)
    settings: dict[str, Any] = {
        "law": "steric", "parameters": {"E": 100.0, "eta": 1.0, "nu": 0.5, "Pi0": 10.0, "L": 0.02},
        "positions": x, "radii": radii, "box": list(box), "depth": 3.0, "gap": 0.02, "range": 0.3, "tangential": True,
        "drag": 1.0, "stress": {"xy": 2.0, "pressure": 1.0}, "until_t": 0.3, "times": 3, "rtol": 1e-5, "target": "c",
    }  # fmt: skip
    return ParticleScene(**{**settings, **changes})


def channel() -> ParticleScene:
    """Spheres between walls, one of which moves as an expression of time says; pushed, held and turned."""
    return ParticleScene(
        law="equal_spheres", parameters={"E": 50.0, "eta": 1.5, "nu": 0.3},
        positions=[[0.0, 1.1], [2.2, 1.15], [1.1, 3.1], [4.3, 1.1]], radii=[1.0, 1.0, 1.1, 0.9], tangential=True,
        wall=[Wall([0.0, 0.0], [0.0, -1.0]), Wall([0.0, 4.4], [0.0, 1.0], False, ["0.3*cos(2*t)", -0.01])],
        push=[Push([1], ["0.2*exp(-t)", 0.0], [0.05])], hold=[Hold([3], "xy", [-0.1, 0.0], [0.2])],
        gap=0.02, range=0.5, drag=1.0, until_t=1.0, times=3, rtol=1e-5, target="c",
    )  # fmt: skip


@cache
def scenes() -> dict[str, ParticleScene]:
    """Every stock scene, and some with what these do not have."""
    stock = {name: shortened(path) for name, path in particle_scenes().items()}
    return {**stock, "column": column(), "layer": layer(), "channel": channel()}


SCENES = (*particle_scenes(), "column", "layer", "channel")


@cache
def as_written(name: str) -> dict[str, Array]:
    """What a scene tells."""
    return told(simulate_particles(scenes()[name]))


@cache
def moved_by_rounding(name: str) -> dict[str, float]:
    """By how much of each largest value rounding of its numbers moves what a scene tells."""
    scene, plain = scenes()[name], as_written(name)
    moved = dict.fromkeys(plain, 0.0)
    for seed in range(2):
        # a hundred roundings, of positions, time and stiffness
        noise = 1 + 2e-14 * np.random.default_rng(seed).uniform(-1, 1, np.shape(scene.positions))
        positions = np.asarray(scene.positions, float) * noise
        if scene.box is not None:
            edges = np.array([np.inf if edge is None else edge for edge in scene.box])
            positions = np.where(np.asarray(scene.positions) <= edges, np.minimum(positions, edges), positions)
        other = told(simulate_particles(replace(scene, positions=positions)))
        for key, values in plain.items():
            same = values.shape == other[key].shape
            moved[key] = max(moved[key], off(values, other[key]) if same else np.inf)
    return moved


def off(values: Array, other: Array) -> float:
    """Largest difference, relative to the largest value."""
    finite = np.isfinite(values)
    assert np.array_equal(finite, np.isfinite(other))
    largest = float(np.abs(values[finite]).max(initial=0.0))
    difference = float(np.abs(values[finite] - other[finite]).max(initial=0.0))
    return difference / largest if largest > 0 else difference


def test_every_observable_is_looked_at() -> None:
    public = {
        name
        for name, value in vars(observables).items()
        if inspect.isfunction(value) and value.__module__ == observables.__name__ and not name.startswith("_")
    }
    assert public == set(OBSERVABLES)


decades = st.integers(-9, 9)
odd = st.floats(0.3, 3.0)


#: Where rounding decides which grains touch first.
COLLIDING = ("collapse", "hopper", "drum", "shear_dry")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if name not in COLLIDING])
@given(powers=st.tuples(decades, decades, decades), odds=st.tuples(odd, odd, odd))
@settings(max_examples=4, deadline=None)
def test_units_change_no_result(name: str, powers: tuple[int, ...], odds: tuple[float, ...]) -> None:
    """By no more than ten times what a hundred roundings of its numbers do, and what Newton's iteration leaves."""
    units: Units = tuple(odd * 10.0**power for odd, power in zip(odds, powers, strict=True))  # type: ignore[assignment]
    scene = scenes()[name]
    plain, moved = as_written(name), moved_by_rounding(name)
    other = told(simulate_particles(in_units(scene, units)), units)
    assert set(other) == set(plain)
    for key, values in plain.items():
        assert values.shape == other[key].shape, key
        assert off(values, other[key]) <= 10 * moved[key] + 1e-2 * scene.rtol, key


#: Without an imposed stress no logarithm of a length is taken; drives of channel and platelets are expressions of t.
EXACT = tuple(name for name in SCENES if name not in ("column", "layer", "channel", "platelets"))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in ("spheres", "drum", "bubbles") else []) for name in EXACT],
)
def test_units_that_are_powers_of_two_change_nothing_to_the_bit(name: str) -> None:
    """Such factors are exact, and so are roots of those of four: nothing at all may know a unit."""
    scene = scenes()[name]
    plain = as_written(name)
    for units in ((2.0**-24, 2.0**40, 2.0**-36), (2.0**32, 2.0**-48, 2.0**24)):
        other = told(simulate_particles(in_units(scene, units)), units)
        for key, values in plain.items():
            np.testing.assert_array_equal(values, other[key], err_msg=key)


@pytest.mark.slow
def test_the_stress_is_that_of_a_layer_as_deep_as_it_is_said_to_be() -> None:
    """Twice the depth is half the stress, and the same motion at half the imposed one."""
    free = layer(stress={}, shear_rate=0.5)
    one, two = (simulate_particles(replace(free, depth=depth)) for depth in (3.0, 6.0))
    np.testing.assert_array_equal(one.x, two.x)
    np.testing.assert_allclose(one.stress, 2 * two.stress, rtol=1e-14)
    excess = [observables.relative_viscosity(result)[1:] - 1 for result in (one, two)]
    np.testing.assert_allclose(excess[0], 2 * excess[1], rtol=1e-12)
    # what resists the box, 2 eta D, is a stress too
    imposed = [
        simulate_particles(layer(depth=depth, stress={"xy": 6 / depth}, stress_viscosity=3 / depth))
        for depth in (3.0, 6.0)
    ]
    np.testing.assert_allclose(imposed[0].x, imposed[1].x, rtol=1e-9)


def test_without_a_word_a_layer_is_as_deep_as_two_mean_radii_and_a_column_as_wide() -> None:
    flat = simulate_particles(layer(depth=None, until_t=0.01))
    assert float(flat.depth) == pytest.approx(2 * flat.radii.mean(), rel=1e-15)
    thin = simulate_particles(column(until_t=0.01))
    assert float(thin.depth) == pytest.approx(2 * thin.radii.mean(), rel=1e-15)
    # along a column the one stress is the force over its width times its depth
    contacts = thin.contacts(-1)
    r = thin.radii[contacts["i"]] + thin.radii[contacts["j"]] + contacts["h"] - 2 * contacts["delta"]
    virial = float(contacts["F"] @ r) / float(thin.cell[-1, 0, 0])
    assert -thin.stress[-1, 0, 0] == pytest.approx(virial / float(thin.depth) ** 2, rel=1e-9)


def test_files_and_checkpoints_carry_the_depth(tmp_path: Path) -> None:
    scene = layer(stress={}, shear_rate=0.5, until_t=0.02)
    result = simulate_particles(scene)
    again = load_particles(result.save(tmp_path / "a.npz"))
    assert float(again.depth) == 3.0
    assert read_particles(tmp_path / "a.npz")["depth"] == 3.0

    def stop(t: float, *_: int) -> None:
        raise KeyboardInterrupt

    path = tmp_path / "b.checkpoint.npz"
    with pytest.raises(KeyboardInterrupt):
        simulate_particles(scene, stop, path)
    with pytest.raises(SceneError, match="another"):
        simulate_particles(replace(scene, depth=2.0), checkpoint=path, resume=True)
    from softdyn.particles.checkpoint import fingerprint

    system = prepare(scene)
    assert load_checkpoint(path, fingerprint(system), system)[0].box.depth == 3.0
    resumed = simulate_particles(scene, checkpoint=path, resume=True)
    np.testing.assert_allclose(resumed.stress, result.stress, rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": 0.0}, "depth must be a positive number"),
        ({"depth": float("nan")}, "depth must be a positive number"),
        ({"depth": "1"}, "depth must be a positive number"),
        ({"box": [12.0, None], "stress": {}}, "periodic along all axes"),
        ({"positions": [[1.0, 1.0, 1.0], [4.0, 4.0, 4.0]], "radii": 1.0, "box": [9.0] * 3, "stress": {}}, "no layer"),
    ],
)
def test_a_depth_without_a_meaning_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        simulate_particles(layer(**changes))


@pytest.mark.slow
def test_a_packing_takes_a_depth_and_nothing_else_of_a_box() -> None:
    data = tomllib.loads(particle_scenes()["emulsion"].read_text())
    assert particle_scene_from({**data, "box": {"depth": 2.5}}, Path()).depth == 2.5
    with pytest.raises(SceneError, match="but for its depth"):
        particle_scene_from({**data, "box": {"lengths": [1, 1]}}, Path())


@pytest.mark.slow
@pytest.mark.parametrize("power", [-30, 30])
def test_a_random_packing_is_the_same_in_other_units_to_the_bit(power: int) -> None:
    unit = 2.0**power
    x, radii, box = random_packing(50, 2, 0.84, [1.0, 1.4], 1)
    other = random_packing(50, 2, 0.84, [unit, 1.4 * unit], 1)
    for one, two in zip((x, radii, box), other, strict=True):
        np.testing.assert_array_equal(one * unit, two)


@pytest.mark.parametrize("rate", [1e-25, 1e-6, 1e25])
def test_the_images_of_a_slow_box_move_as_fast_as_it_says(rate: float) -> None:
    """A whole period's image, however long a second is."""
    from softdyn.particles.neighbours import find_contacts
    from softdyn.particles.system import moving_images

    scene = layer(stress={}, shear_rate=rate, tangential=False)
    system = prepare(scene)
    contacts, *_ = find_contacts(system, system.x, 0.0, None)
    rows, velocities = moving_images(system, contacts, 0.1 / rate)
    expected = rate * contacts.shift[rows, 1] * system.box.lengths[1]
    assert expected.any()
    np.testing.assert_allclose(velocities[:, 0], expected, rtol=1e-14)
