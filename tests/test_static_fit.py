"""Laws fitted to forces at gaps where nothing moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softdyn
from softdyn.cli import main
from softdyn.errors import IntegrationError, LawError, SceneError
from softdyn.fitting.curve_data import CurveData
from softdyn.fitting.static_model import SHIFT, StaticModel
from softdyn.laws import law_of

#: Spheres of 10 um that repel over 10 nm: a modulus at which they give way by as much as the gap.
SPHERES = {"R": 1e-5, "E": 1e5, "eta": 1e-3, "nu": 0.5, "Pi0": 5e4, "L": 2e-8}


def model_of(gaps: Any, names: list[str], law: str = "steric", **numbers: float) -> StaticModel:
    curve = CurveData("curve", {"h": np.array(gaps), "F": np.zeros(len(gaps))}, ())
    return StaticModel(law_of(law), [curve], {**SPHERES, SHIFT: 0.0, **numbers}, {name: (None, name) for name in names})


@pytest.mark.slow
@pytest.mark.parametrize("force", [1e-11, 1e-9, 1e-8])
def test_the_force_at_a_gap_is_that_with_which_the_pair_comes_to_rest_there(force: float) -> None:
    """The engine of pairs ends where nothing moves; it knows nothing of equilibria."""
    run = softdyn.simulate(law="steric", parameters=SPHERES, h=3e-8, force=force, until_t=1e6)
    assert run.delta[-1] > 1e-3 * run.h[-1]  # soft enough to matter
    found, _ = model_of([run.h[-1]], [])(np.empty(0))
    # the gap is known to rtol = 1e-9, and the force falls with it over a part of L
    assert found[0] == pytest.approx(force, rel=1e-7)


@pytest.mark.parametrize("name", ["Pi0", "L", "E", SHIFT])
def test_derivatives_are_those_of_the_forces(name: str) -> None:
    """By a parameter, by the modulus that only the deflection knows, and by the gap: central differences of 1e-4."""
    gaps = [4e-9, 1e-8, 2e-8, 3e-8]
    start = {**SPHERES, SHIFT: 1e-9}[name]
    model = model_of(gaps, [name])
    _, slopes = model(np.array([start]))
    step = 1e-4 * start
    ahead, behind, twice, back = (model(np.array([start + k * step]))[0] for k in (1, -1, 2, -2))
    differences = (8 * (ahead - behind) - (twice - back)) / (12 * step)
    # errors: of the fifth derivative, some (1e-4)^4; of rounding, 1e-16 of the force over the step; bisection, 1e-15
    scale = np.abs(model(np.array([start]))[0]) / start
    assert slopes[:, 0] == pytest.approx(differences, abs=float(1e-10 * scale.max()))


def test_synthetic_curves_give_their_parameters_within_the_errors_that_are_told() -> None:
    names = ["Pi0", "L", SHIFT]
    gaps = np.linspace(4e-9, 3.5e-8, 40)
    exact, _ = model_of(gaps, names)(np.array([SPHERES["Pi0"], SPHERES["L"], 0.0]))
    noise = np.random.default_rng(3).normal(0.0, 1e-11, len(gaps))
    data = {"h [nm]": 1e9 * gaps + 1.5, "F [nN]": 1e9 * (exact + noise)}
    known = {**SPHERES, "Pi0": 3e4, "L": 1.7e-8}
    fit = softdyn.fit("steric", data, free=names, parameters=known, drive="static", profiles=False)
    for name, value in (("Pi0", SPHERES["Pi0"]), ("L", SPHERES["L"]), (SHIFT, -1.5e-9)):
        assert abs(fit.values[name] - value) < 3 * fit.errors[name] < 0.1 * abs(value)
    assert "shift" in str(fit)


def test_the_command_fits_two_tables_with_shifts_of_their_own(tmp_path: Path, capsys: Any) -> None:
    law = model_of(np.linspace(5e-9, 3e-8, 12), ["Pi0"])
    exact, _ = law(np.array([5e4]))
    for k, shift in enumerate((1.0, -0.5)):
        rows = np.column_stack([1e9 * law.curves[0].columns["h"] + shift, 1e9 * exact])
        np.savetxt(tmp_path / f"{k}.csv", rows, delimiter=",", header="h [nm],F [nN]", comments="")
    given = "R=10um,E=0.1MPa,nu=0.5,Pi0=40kPa,L=20nm"
    tables = [str(tmp_path / "0.csv"), str(tmp_path / "1.csv")]
    options = ["--free", "Pi0,shift", "--set", given, "--drive", "static", "--no-profiles"]
    assert main(["fit", "steric", *tables, *options, "-o", str(tmp_path / "fit.json")]) == 0
    out = capsys.readouterr().out
    assert "shift_1" in out
    found = softdyn.load_result(tmp_path / "fit.json")
    assert found.values["Pi0"] == pytest.approx(5e4, rel=1e-5)
    assert [found.values[f"shift_{k}"] for k in (1, 2)] == pytest.approx([-1e-9, 5e-10], rel=1e-4)


@pytest.mark.parametrize(
    ("law", "change", "words"),
    [
        ("rognon_gay", {}, "has no remote force"),
        ("steric", {"free": ["Pi"]}, "nothing called 'Pi'.*did you mean 'Pi0'"),
        ("steric", {"h": 1e-8}, "a law, its parameters and shift are all"),
        ("steric", {"drive": "statik"}, "or 'static', not 'statik'"),
        ("steric", {"parameters": {"R": 1e-5, "Pi0": 5e4, "L": 2e-8}}, "E, nu missing"),
        ("steric", {"data": {"t": [0.0, 1.0], "F": [0.0, 1.0]}}, "h missing"),
    ],
)
def test_what_has_no_static_force_is_refused(law: str, change: dict[str, Any], words: str) -> None:
    data = change.pop("data", {"h": np.linspace(5e-9, 3e-8, 5), "F": np.ones(5)})
    spheres = {"R": 1e-5, "E": 1e5, "eta": 1e-3} if law == "rognon_gay" else SPHERES
    given: dict[str, Any] = {"free": ["E" if law == "rognon_gay" else "Pi0"], "parameters": spheres, "drive": "static"}
    with pytest.raises((SceneError, LawError), match=words):
        softdyn.fit(law, data, **{**given, **change})


def test_gaps_at_which_surfaces_jump_into_contact_are_told() -> None:
    """Attraction grows as 1/h^2, and no surface is pulled out that far."""
    dlvo = {"nu": 0.5, "Pi0": 0.0, "ell": 1e-8, "A": 1e-18, "E": 1e3}
    curve = CurveData("curve", {"h": np.array([1e-10]), "F": np.zeros(1)}, ())
    numbers = {**SPHERES, **dlvo, SHIFT: 0.0}
    with pytest.raises(IntegrationError, match="surfaces would jump"):
        StaticModel(law_of("dlvo"), [curve], numbers, {})(np.empty(0))
    with pytest.raises(IntegrationError, match=r"the gap of row 1 is -1e-10"):
        StaticModel(law_of("dlvo"), [curve], {**numbers, SHIFT: -2e-10}, {})(np.empty(0))
