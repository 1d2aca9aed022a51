"""Batches: each of many runs is the run that would be made alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.errors import SceneError
from softdyn.pair.batch import Batch, simulate_batch
from softdyn.pair.pair_run import simulate_pair
from softdyn.scene.pair_quantities import QUANTITIES
from softdyn.scene.pair_scene import Scene
from softdyn.scene.time_tables import Table

PAPER: dict[str, Any] = {"law": "rognon_gay", "parameters": {"R": 2.0, "E": 3.0, "eta": 0.5}, "h": 10.0}
FORCES = np.geomspace(1e-5, 0.3, 40)
WAVE = "F0*(1 + 0.5*sin(w*t))"

#: Scenes of every kind that a kernel makes runs of, and what is varied in them.
SCENES: dict[str, tuple[Scene, dict[str, Any]]] = {
    "times": (Scene(**PAPER, force=1.0, until_t=1e4, times=23), {"force": FORCES}),
    "given times": (Scene(**PAPER, force=1.0, until_t=1e4, times=[0.0, 1.0, 77.0, 9e3]), {"force": FORCES}),
    "gaps": (Scene(**PAPER, force=1.0, until_h=1e-3, gaps=30), {"force": FORCES, "h": np.linspace(5, 20, 40)}),
    "given gaps": (Scene(**PAPER, force=1.0, until_h=1e-3, gaps=[10.0, 1.0, 1e-2, 1e-3]), {"force": FORCES}),
    "the end": (Scene(**PAPER, force=1.0, until_t=1e4), {"E": np.geomspace(0.1, 10, 40)}),
    "the last gap": (Scene(**PAPER, force=1.0, until_h=1e-2), {"eta": np.geomspace(0.1, 10, 40)}),
    "tension": (Scene(**PAPER, force=-1.0, until_h=100.0, gaps=9), {"force": -FORCES}),
    "both signs": (Scene(**PAPER, force=1.0, until_t=10.0, times=5), {"force": np.linspace(-0.1, 0.1, 40)}),
    "expression": (
        Scene(**PAPER, force=WAVE, constants={"F0": 1e-2, "w": 1e-2}, until_t=3e3, times=40),
        {"F0": FORCES, "w": np.geomspace(1e-3, 1e-2, 40)},
    ),
    "kinks": (
        Scene(**PAPER, force="F0*abs(sin(w*t))", constants={"F0": 1e-2, "w": 1e-2}, until_t=3e3, times=40),
        {"F0": FORCES},
    ),
    "table": (
        Scene(
            **PAPER, force=Table(np.array([0.0, 10, 20, 400]), np.array([0.0, 0.1, 0.1, 0.01])), until_t=300.0, times=11
        ),
        {"h": np.geomspace(1e-2, 10, 40)},
    ),
    "velocity": (Scene(**PAPER, velocity=-1e-2, until_t=500.0, times=11), {"velocity": -np.geomspace(1e-3, 2e-2, 40)}),
    "position": (
        Scene(**PAPER, position="X0 - 1e-3*t", constants={"X0": 14.0}, until_t=9e3, times=11),
        {"eta": np.geomspace(0.1, 10, 40)},
    ),
    "spring": (
        Scene(**PAPER, spring={"stiffness": 2.0, "base": "14 - 1e-3*t"}, until_t=9e3, times=11),
        {"eta": np.geomspace(0.1, 10, 40)},
    ),
    "a film": (
        Scene(law="steric", parameters={"R": 1, "E": 1, "eta": 1, "nu": 0.3, "Pi0": 1e-3, "L": 1e-2}, h=1.0, force=1.0,
              until_t=1e9, times=20),
        {"force": np.geomspace(1e-8, 1e-5, 40)},
    ),
}  # fmt: skip


def cases() -> list[Any]:
    """Every scene in both targets; numba compiles for long."""
    slow = {"c": (), "numba": (pytest.mark.slow,)}
    return [
        pytest.param(name, target, marks=marks, id=f"{name}, {target}")
        for name in SCENES
        for target, marks in slow.items()
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "target"), cases())
def test_each_run_is_that_of_simulate(name: str, target: str) -> None:
    """Outputs are solved for to a thousandth of rtol; steps are the same, unless a last digit of ln h changes them.

    Then both are within their estimated errors.
    Rates are differences, of forces on a film and of one another: they are held to the size of their terms.
    """
    scene, varied = SCENES[name]
    wanted = tuple(q for q in QUANTITIES if q not in ("lambda1", "lambda2"))
    scene = replace(scene, quantities=wanted, target=target)
    found = simulate_batch(scene, varied)
    assert found.errors == {}
    for run in (0, 13, 39):
        point = {key: float(values[run]) for key, values in varied.items()}
        change = {key: value for key, value in point.items() if key in vars(scene)}
        parameters = {**scene.parameters, **{k: v for k, v in point.items() if k in scene.parameters}}
        constants = {**scene.constants, **{k: v for k, v in point.items() if k in scene.constants}}
        alone = simulate_pair(replace(scene, parameters=parameters, constants=constants, **change))
        keep = slice(None) if scene.times is not None or scene.gaps is not None else slice(-1, None)
        for key, expected in alone.arrays.items():
            size = np.abs(expected)
            if key in ("dh_dt", "dX_dt", "ddelta_dt"):
                size = size + np.abs(alone.F) / alone.zeta
            off = np.abs(found.arrays[key][run] - expected[keep])
            allowed = 1e-2 * scene.rtol + 2 * alone.stats["error"]
            assert np.all(off <= allowed * size[keep]), (key, run)


@pytest.mark.slow
def test_simulate_takes_arrays() -> None:
    found = softdyn.simulate(**PAPER, force=np.array([1e-3, 1e-2]), until_h=0.1, gaps=5)
    assert isinstance(found, Batch)
    assert found.h.shape == (2, 5)
    assert repr(found).startswith("Batch of 2 runs, 0 of them failed; varied: force; arrays: t, h")
    assert len(found) == 2
    np.testing.assert_array_equal(found.varied["force"], [1e-3, 1e-2])
    alone = softdyn.simulate(**PAPER, force=1e-2, until_h=0.1, gaps=5)
    np.testing.assert_allclose(found.t[1], alone.t, rtol=1e-11)


def test_several_arrays_are_taken_value_by_value() -> None:
    parameters = {"R": 2.0, "E": np.array([1.0, 2.0, 3.0]), "eta": 0.5}
    found = softdyn.simulate(
        law="rognon_gay", parameters=parameters, h=np.array([1.0, 2.0, 3.0]), force=1e-2, until_h=0.1, gaps=4
    )
    assert isinstance(found, Batch)
    for run in range(3):
        alone = softdyn.simulate(
            law="rognon_gay", parameters={"R": 2.0, "E": run + 1.0, "eta": 0.5}, h=run + 1.0, force=1e-2, until_h=0.1,
            gaps=4,
        )  # fmt: skip
        np.testing.assert_allclose(found.t[run], alone.t, rtol=1e-11)


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(SceneError, match="as many values each; here there are 3 of h, 2 of force"):
        softdyn.simulate(**{**PAPER, "h": np.ones(3)}, force=np.ones(2), until_h=0.1)
    for lossy in (np.array([1e-2j, 1.0]), np.array([True, False]), np.array(["1", "2"]), np.ma.array([1.0, 2.0])):
        with pytest.raises(SceneError, match=r"force is (an array of .* real numbers|a masked array)"):
            softdyn.simulate(**PAPER, force=lossy, until_h=0.1)
    for values in ([1e-2, 2e-2], [10**400, 1]):
        with pytest.raises(SceneError, match="a table is"):
            softdyn.simulate(**PAPER, force=values, until_h=0.1)
    with pytest.raises(SceneError, match=r"force is an array of shape \(2, 2\)"):
        softdyn.simulate(**PAPER, force=np.ones((2, 2)), until_h=0.1)
    with pytest.raises(SceneError, match=r"h is an array of shape \(0,\)"):
        softdyn.simulate(**{**PAPER, "h": np.ones(0)}, force=1.0, until_h=0.1)


@pytest.mark.slow
def test_what_fails_says_why_and_leaves_the_others() -> None:
    """A negative parameter, a gap that is no number, a force that moves the gap the other way: three rows of nan."""
    found = softdyn.simulate(
        law="rognon_gay", parameters={"R": 2.0, "E": np.array([3.0, -1.0, 3.0, 3.0]), "eta": 0.5},
        h=np.array([10.0, 10.0, np.nan, 10.0]), force=np.array([1e-2, 1e-2, 1e-2, -1e-2]), until_h=0.1, gaps=3,
    )  # fmt: skip
    assert isinstance(found, Batch)
    assert sorted(found.errors) == [1, 2, 3]
    assert "E must be positive, not -1.0" in found.errors[1]
    assert "h must be a positive number, not nan" in found.errors[2]
    assert "moves the gap the other way" in found.errors[3]
    assert np.isfinite(found.t[0]).all()
    assert np.isnan(found.t[1:]).all()


@pytest.mark.parametrize("bad", [{"force": np.nan}, {"h": -1.0}, {"E": -1.0}, {"E": np.nan}])
def test_the_first_run_may_be_the_one_that_fails(bad: dict[str, float]) -> None:
    (name,) = bad
    good = {"force": 1e-2, "h": 1.0, "E": 3.0}[name]
    values = np.array([bad[name], good])
    keywords: dict[str, Any] = {**PAPER, "force": 1e-2, "until_h": 0.1}
    keywords |= {"parameters": {**PAPER["parameters"], "E": values}} if name == "E" else {name: values}
    found = softdyn.simulate(**keywords)
    assert list(found.errors) == [0]
    assert name in found.errors[0]
    assert np.isnan(found.t[0]).all()
    assert np.isfinite(found.t[1]).all()


def test_an_X_that_contradicts_is_told_of_its_run() -> None:
    """X = 2R + h - 2 delta of the first run; the second is pushed harder, and deflected more."""
    alone = softdyn.simulate(**PAPER, force=1e-2, until_h=0.1)
    found = softdyn.simulate(**PAPER, X=float(alone.X[0]), force=np.array([1e-2, 2e-2]), until_h=0.1)
    assert isinstance(found, Batch)
    assert list(found.errors) == [1]
    assert "contradicts" in found.errors[1]


def test_warnings_name_their_run() -> None:
    found = softdyn.simulate(**PAPER, force=np.array([1e-2, 30.0]), until_h=0.1)
    assert isinstance(found, Batch)
    assert list(found.warnings) == [1]
    assert "outside the model" in found.warnings[1][0]


@pytest.mark.slow
def test_a_run_whose_errors_grow_is_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forces that reverse let errors grow; the estimate of the kernel is that of simulate."""
    scene = Scene(
        **{**PAPER, "h": 1e-3}, force=WAVE, constants={"F0": -1e-2, "w": 1.0}, until_t=3e5, times=5, rtol=1e-3
    )
    made = []
    original = softdyn.pair.batch.simulate_pair  # type: ignore[attr-defined]
    monkeypatch.setattr(
        "softdyn.pair.batch.simulate_pair", lambda *args, **more: made.append(1) or original(*args, **more)
    )
    found = simulate_batch(scene, {"F0": np.array([1e-2, -1e-2])})
    alone = simulate_pair(replace(scene, constants={"F0": -1e-2, "w": 1.0}))
    assert (alone.stats["rtol"] < scene.rtol) == bool(made)
    if not found.errors:
        np.testing.assert_allclose(found.h[1], alone.h, rtol=2 * 10 * scene.rtol)


def test_a_table_of_a_batch_is_read_back(tmp_path: Path) -> None:
    found = softdyn.simulate(**PAPER, force=np.array([1e-3, 1e-2]), until_h=0.1, gaps=5)
    with np.load(found.save(tmp_path / "many.npz")) as table:
        np.testing.assert_array_equal(table["varied_force"], [1e-3, 1e-2])
        np.testing.assert_array_equal(table["h"], found.h)
    rows = np.genfromtxt(found.save(tmp_path / "many.csv"), delimiter=",", names=True)
    np.testing.assert_array_equal(rows["t"].reshape(2, 5), found.t)
    with pytest.raises(SceneError, match=r"must be \.npz or \.csv"):
        found.save(tmp_path / "many.json")
