"""Fits recover what made the data, say how well, and name what the data do not tell."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, norm
from sympy import Abs, Rational, Symbol, exp, pi, sqrt

import softdyn
from softdyn.cli import main
from softdyn.derive import FORCE, LENGTH, ContactLaw, E, R, delta, eta, h
from softdyn.errors import SceneError
from softdyn.fitting.least_squares import Parameter, profile, solve, undetermined
from softdyn.rheology.flow_laws import fit_flow_law

Array = np.ndarray[Any, Any]
SPHERES = {"R": 1.0, "E": 1.0, "eta": 1.0}
#: Of colloidal probes, in SI units.
PROBE = {"R": 10e-6, "E": 1e5, "eta": 1e-3, "nu": 0.5}


@cache
def drainage() -> tuple[Array, Array]:
    """A film that drains and flattens under a constant force: times and gaps."""
    t = np.linspace(0.0, 3e5, 40)
    run = softdyn.simulate(law="rognon_gay", parameters=SPHERES, h=0.1, force=1e-3, until_t=t[-1], times=t.tolist())
    return t, run.h


def fit_drainage(gaps: Array, **given: Any) -> softdyn.Fit:
    t, _ = drainage()
    told: dict[str, Any] = {"free": ["eta"], "parameters": {**SPHERES, "eta": 2.0}, "h": 0.1, "drive": {"force": 1e-3}}
    return softdyn.fit("rognon_gay", {"t": t, "h": gaps}, **{**told, "profiles": False, **given})


def noise(number: int, size: int) -> Array:
    return np.random.default_rng(number).standard_normal(size)


# --- what is least, and what it tells: against what is known of straight lines ---


def line(x: Array) -> Any:
    return lambda p: (p[0] + p[1] * x, np.column_stack([np.ones_like(x), x]))


def test_errors_and_profiles_of_a_straight_line_are_those_of_regression() -> None:
    x = np.linspace(0.0, 1.0, 30)
    y = 1 + 2 * x + 0.1 * noise(1, 30)
    free = [Parameter("a", 0.5, by_log=False), Parameter("b", 0.5, by_log=False)]
    groups = np.zeros(30, dtype=np.int64)
    known = solve(line(x), free, y, np.full(30, 0.1), groups)
    design = np.column_stack([np.ones(30), x])
    assert known.covariance == pytest.approx(0.01 * np.linalg.inv(design.T @ design), rel=1e-9)
    # unknown errors: from what is left, by its degrees of freedom, and Student's t
    unknown = solve(line(x), free, y, np.full(30, math.nan), groups)
    left = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
    assert unknown.sigma[0] == pytest.approx(math.sqrt(left @ left / 28), rel=1e-9)
    for number in range(2):
        one = profile(line(x), unknown, y, number)
        low, high = unknown.intervals()["ab"[number]]
        # chi2 is a parabola: the profile is the standard error
        assert (one.low, one.high) == pytest.approx((low, high), rel=1e-6)


def test_a_positive_parameter_is_fitted_by_its_logarithm_whatever_its_unit() -> None:
    x = np.linspace(0.0, 3.0, 30)
    y = np.exp(-x) * (1 + 0.01 * noise(2, 30))
    found = []
    for unit in (1.0, 1e-20):

        def decay(p: Array, unit: float = unit) -> tuple[Array, Array]:
            value = p[0] / unit * np.exp(-p[1] * x)
            return value, np.column_stack([value / p[0], -x * value])

        free = [Parameter("A", 3 * unit, 0.0), Parameter("k", 3.0, 0.0)]
        solution = solve(decay, free, y, np.full(30, 0.01), np.zeros(30, dtype=np.int64))
        found.append((solution.values["A"] / unit, solution.errors["A"] / unit, solution.chi2))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_a_loss_that_is_robust_is_not_led_astray() -> None:
    x = np.linspace(0.0, 1.0, 40)
    y = 1 + 2 * x + 0.01 * noise(3, 40)
    y[5] += 3.0  # somebody touched the table
    free = [Parameter("a", 0.5, by_log=False), Parameter("b", 0.5, by_log=False)]
    groups = np.zeros(40, dtype=np.int64)
    off = {}
    for loss in ("linear", "soft_l1", "huber", "cauchy"):
        found = solve(line(x), free, y, np.full(40, math.nan), groups, loss)
        off[loss] = abs(found.values["b"] - 2)
        if loss != "linear":
            assert off[loss] < 4 * found.errors["b"]
            assert found.sigma[0] == pytest.approx(0.01, rel=0.5)
    assert max(off[loss] for loss in off if loss != "linear") < 0.05 * off["linear"]


def test_what_a_product_alone_is_known_of_is_named_with_the_product() -> None:
    x = np.linspace(0.5, 1.0, 20)

    def model(p: Array) -> tuple[Array, Array]:  # of a b^2 alone
        value = p[0] * p[1] ** 2 * x
        return value, np.column_stack([value / p[0], 2 * value / p[1]])

    free = [Parameter("a", 2.0, 0.0), Parameter("b", 1.0, 0.0)]
    found = solve(model, free, x * 1.5, np.full(20, 0.01), np.zeros(20, dtype=np.int64))
    ((moved, known),) = undetermined(found)
    assert known is not None
    assert moved.powers["b"] / moved.powers["a"] == pytest.approx(-0.5, rel=1e-6)
    assert known.powers["b"] / known.powers["a"] == pytest.approx(2.0, rel=1e-6)
    # of the sum of 20 points, each known to 0.01
    assert known.error * (1 / known.powers["a"]) == pytest.approx(0.01 / math.sqrt(float(x @ x)) / 1.5, rel=1e-3)


# --- laws of contacts ---


@pytest.mark.slow
def test_exact_data_give_the_parameters_exactly() -> None:
    _, h = drainage()
    found = fit_drainage(h, free=["eta", "E"], parameters={**SPHERES, "eta": 1.7, "E": 0.4})
    assert found.values == pytest.approx({"eta": 1.0, "E": 1.0}, rel=1e-6)


@pytest.mark.slow
def test_profiles_say_what_standard_errors_do_where_these_are_small() -> None:
    _, h = drainage()
    found = fit_drainage(h * (1 + 1e-3 * noise(4, 40)), profiles=True)
    low, high = found.intervals["eta"]
    reach = 2.02 * found.errors["eta"]  # Student's t of 39
    assert (low, high) == pytest.approx((found.values["eta"] - reach, found.values["eta"] + reach), rel=0.01 * reach)
    assert found.profile_eta_chi2.min() == 0


@pytest.mark.slow
def test_force_and_viscosity_are_known_by_their_ratio_alone() -> None:
    # rigid as they are, dh/dt goes as F/eta: the data cannot tell the two apart, and the fit says so
    t, _ = drainage()
    stiff = {**SPHERES, "E": 1e6}
    run = softdyn.simulate(law="rognon_gay", parameters=stiff, h=0.1, force=1e-3, until_t=t[-1], times=t.tolist())
    found = fit_drainage(
        run.h * (1 + 1e-3 * noise(5, 40)), free=["eta", "force"], parameters={**stiff, "eta": 1.1}, h=0.1
    )
    (words,) = found.undetermined
    assert "together, change chi2 by 1 only" in words
    assert "known is eta force^-1, to 0." in words or "known is eta^-1 force, to 0." in words
    assert "not determined: " in str(found)
    assert found.values["force"] / found.values["eta"] == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.slow
def test_a_modulus_that_does_not_matter_is_not_determined() -> None:
    stiff = {**SPHERES, "E": 1e9}
    t, _ = drainage()
    run = softdyn.simulate(law="rognon_gay", parameters=stiff, h=0.1, force=1e-3, until_t=t[-1], times=t.tolist())
    found = fit_drainage(run.h * (1 + 1e-3 * noise(6, 40)), free=["eta", "E"], parameters=stiff, profiles=True)
    assert any(words.startswith("E ") for words in found.undetermined)
    assert found.intervals["E"][1] == math.inf
    assert found.errors["eta"] < 0.01


def test_curves_share_the_law_and_have_starts_of_their_own() -> None:
    t = np.linspace(0.0, 2e5, 30)
    curves, forces = [], (1e-3, 1e-3)
    for h0, force in zip((0.1, 0.3), forces, strict=True):
        run = softdyn.simulate(law="rognon_gay", parameters=SPHERES, h=h0, force=force, until_t=t[-1], times=t.tolist())
        curves.append({"t": run.t, "h": run.h})
    found = softdyn.fit(
        "rognon_gay", curves, free=["eta", "h"], parameters={**SPHERES, "eta": 1.5}, h=[0.12, 0.25],
        drive={"force": 1e-3}, profiles=False,
    )  # fmt: skip
    assert found.values == pytest.approx({"eta": 1.0, "h_1": 0.1, "h_2": 0.3}, rel=1e-6)


def test_units_of_headings_and_of_numbers_are_one_set(tmp_path: Path) -> None:
    """The same data in nm, ms and minutes, with a BOM, semicolons and decimal commas, as bare numbers in SI units."""
    parameters = {"R": 10e-6, "E": 1e5, "eta": 1e-3}
    t = np.linspace(0.0, 2.0, 25)
    run = softdyn.simulate(law="rognon_gay", parameters=parameters, h=1e-6, force=1e-9, until_t=2.0, times=t.tolist())
    h = run.h * (1 + 1e-3 * noise(7, 25))
    path = tmp_path / "film.csv"
    rows = "\n".join(f"{a * 1e3!r};{b * 1e9!r}".replace(".", ",") for a, b in zip(t.tolist(), h.tolist(), strict=True))
    path.write_text(f"time [ms];h (nm)\n{rows}\n", encoding="utf-8-sig")
    with_units = softdyn.fit(
        "rognon_gay", path, free=["eta"], parameters={"R": "10 um", "E": "1 bar", "eta": "3 mPa s"}, h="1 um",
        drive={"force": "1 nN"}, profiles=False,
    )  # fmt: skip
    bare = softdyn.fit(
        "rognon_gay", {"t": t, "h": h}, free=["eta"], parameters={**parameters, "eta": 3e-3}, h=1e-6,
        drive={"force": 1e-9}, profiles=False,
    )  # fmt: skip
    assert with_units.values["eta"] == pytest.approx(bare.values["eta"], rel=1e-9)
    assert with_units.about["units"] == {"eta": "Pa s"}
    assert bare.about["units"] == {}


def test_a_flow_curve_is_fitted_as_by_its_own_fit(tmp_path: Path) -> None:
    rates = np.geomspace(0.01, 100, 25)
    error = 0.01 * (12 + 8 * rates**0.5)
    stress = 12 + 8 * rates**0.5 + error * noise(8, 25)
    found = softdyn.fit("herschel-bulkley", {"rate [1/s]": rates, "stress [Pa]": stress, "stress_error [Pa]": error})
    other = fit_flow_law("Herschel-Bulkley", rates, stress, error)
    assert found.values == pytest.approx(dict(other.values), rel=1e-4)
    for name, (low, high) in found.intervals.items():
        # profiles are nearly parabolas, of the standard errors
        assert (high - low) / (2 * 1.96 * other.errors[name]) == pytest.approx(1.0, abs=0.1)
        assert abs(found.values[name] - {"sigma_y": 12, "K": 8, "n": 0.5}[name]) < 3.3 * found.errors[name]
    assert found.undetermined == ()
    assert softdyn.load_result(found.save(tmp_path / "flow.json")).values == found.values


# --- an AFM curve, as people have it ---


@pytest.mark.slow
def test_intervals_of_degenerate_parameters_hold_the_truth() -> None:
    """The size of a force and the gap at the start stand for one another, over decades: valleys are long and curved."""
    F0, lam = Symbol("F0", positive=True), Symbol("lam", positive=True)
    law = ContactLaw(
        name="degenerate",
        a=sqrt(R * Abs(delta) + 2 * R * h),
        F_ela=Rational(2, 3) * E * sqrt(R * Abs(delta)) * delta,
        zeta=3 * pi * eta * R**2 / (2 * h),
        F_adh=F0 * exp(-h / lam),
        parameters={F0: FORCE, lam: LENGTH},
    )
    known = {"R": 10e-6, "E": 1e5, "eta": 1e-3}
    truth = {"F0": 2e-9, "lam": 30e-9, "h": 250e-9}
    t = np.linspace(0, 1.3, 100)
    base = -2e-7 * t
    start = {"F0": truth["F0"], "lam": truth["lam"]}
    spring = {"stiffness": 0.05, "base": (t, base + known["R"] * 2 + truth["h"])}
    run = softdyn.simulate(
        law=law, parameters={**known, **start}, h=truth["h"], until_t=1.3, times=t.tolist(), spring=spring
    )
    data = {"t": t, "Z": base, "F": run.F + 2e-12 * noise(1, 100), "F_error": np.full(100, 2e-12)}
    found = softdyn.fit(
        law, data, free=["F0", "lam", "h"], parameters={**known, **start}, h=truth["h"],
        drive={"spring": {"stiffness": 0.05, "base": "Z"}},
    )  # fmt: skip
    for name, (low, high) in found.intervals.items():
        assert low < truth[name] < high
        # of what rises to the limit at all; known errors are normal
        rise, values = found.arrays[f"profile_{name}_chi2"], found.arrays[f"profile_{name}"]
        inside = (values > low) & (values < high)
        assert (rise[inside] < norm.ppf(0.975) ** 2 * 1.1).all()


def test_a_law_that_does_not_describe_the_data_is_told() -> None:
    """A power law of what has a yield stress; with errors a hundred times as large it cannot be told from one."""
    rates = np.logspace(-2, 2, 25)
    stress = 12 + 8 * rates**0.5 + 0.2 * noise(8, 25)
    for error, told in ((0.2, True), (20.0, False)):
        data = {"rate": rates, "stress": stress, "stress_error": np.full(25, error)}
        found = softdyn.fit("power-law", data)
        assert any("does not describe the data" in words for words in found.warnings) == told
        assert ("does not describe the data" in str(found)) == told
    assert not softdyn.fit("herschel-bulkley", {**data, "stress_error": np.full(25, 0.2)}).warnings


def afm_file(path: Path) -> Path:
    """Force over time of a colloid with a brush, which a piezo pushes with a cantilever of 0.05 N/m; 1 pN of noise."""
    law = {**PROBE, "Pi0": 5e4, "L": 20e-9}
    t = np.linspace(0.0, 1.3, 120)
    z = -2e-7 * t
    base = (t, z + 2 * law["R"] + 250e-9)
    run = softdyn.simulate(
        law="steric", parameters=law, h=250e-9, spring={"stiffness": 0.05, "base": base}, until_t=1.3, times=t.tolist()
    )
    F = run.F + 1e-12 * noise(9, 120)
    rows = zip(t, z * 1e9, F * 1e9, strict=True)
    path.write_text("t [s], Z [nm], F [nN]\n" + "\n".join(f"{a:.6f}, {b:.4f}, {c:.5f}" for a, b, c in rows))
    return path


@pytest.mark.slow
def test_an_afm_curve_takes_five_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    afm_file(tmp_path / "afm.csv")
    monkeypatch.chdir(tmp_path)
    lines = """\
import softdyn
glass = {"R": "10 um", "E": "100 kPa", "eta": "1 mPa s", "nu": 0.5, "Pi0": "30 kPa", "L": "15 nm"}
cantilever = {"spring": {"stiffness": "0.05 N/m", "base": "Z"}}
found = softdyn.fit("steric", "afm.csv", free=["Pi0", "L", "h"], parameters=glass, h="240 nm", drive=cantilever)
print(found), found.plot().savefig("afm.png")"""
    assert len(lines.splitlines()) == 5
    names: dict[str, Any] = {}
    exec(lines, names)
    found = names["found"]
    truth = {"Pi0": 5e4, "L": 20e-9, "h": 250e-9}
    for name, (low, high) in found.intervals.items():
        assert low < truth[name] < high
    assert (tmp_path / "afm.png").stat().st_size > 10_000
    # without its times, by the speed of the piezo
    bare = np.loadtxt("afm.csv", delimiter=",", skiprows=1)
    again = softdyn.fit(
        "steric", {"Z [nm]": bare[:, 1], "F [nN]": bare[:, 2]}, free=["Pi0", "L", "h"], parameters=names["glass"],
        h="240 nm", drive={**names["cantilever"], "speed": "200 nm/s"}, profiles=False,
    )  # fmt: skip
    assert again.values == pytest.approx(found.values, rel=1e-3)


#: What is fitted of each law, in which way the pair is driven, and how large the noise is.
TRIALS: dict[str, tuple[dict[str, float], dict[str, Any], str, float, float, dict[str, float]]] = {
    "equal_spheres": (
        PROBE, {"force": 5e-9}, "h", 0.4, 2e-10, {"eta": 1e-3, "E": 1e5, "h": 1e-6}
    ),
    "steric": (
        {**PROBE, "Pi0": 5e4, "L": 20e-9}, {"velocity": -1e-6}, "F", 0.27, 1e-10, {"Pi0": 5e4, "L": 20e-9}
    ),
    "dlvo": (
        {**PROBE, "Pi0": 3.3e4, "ell": 1e-8, "A": 1e-20}, {"spring": {"stiffness": 0.05, "base": "Z"}}, "F", 1.3, 1e-11,
        {"ell": 1e-8, "h": 250e-9},
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("law", TRIALS)
def test_stated_intervals_hold_the_truth_in_95_of_100_trials(law: str) -> None:
    parameters, drive, quantity, end, size, truth = TRIALS[law]
    # a film that is pressed is seen before and after it flattens
    t = np.linspace(0.0, end, 40) if quantity == "F" else np.geomspace(1e-5, end, 40)
    h0 = truth.get("h", 250e-9)
    place = -2e-7 * t
    made = dict(drive)
    if "spring" in made:
        made = {"spring": {"stiffness": 0.05, "base": (t, place + 2 * parameters["R"] + h0)}}
    run = softdyn.simulate(law=law, parameters=parameters, h=h0, **made, until_t=end, times=t.tolist())
    start = {name: value * 1.2 for name, value in truth.items()}
    trials, inside = 200, dict.fromkeys(truth, 0)
    for number in range(trials):
        data = {"t": t, "Z": place, quantity: run.arrays[quantity] + size * noise(1000 + number, 40)}
        found = softdyn.fit(
            law, data, free=list(truth), parameters={name: start.get(name, parameters[name]) for name in parameters},
            h=start.get("h", h0), drive=drive, profiles=False,
        )  # fmt: skip
        for name, (low, high) in found.intervals.items():
            inside[name] += low < truth[name] < high
    # as often as 95 % of 200 may be, but for one time in a thousand
    low, high = binom.interval(0.999, trials, 0.95)
    for name, count in inside.items():
        assert low <= count <= high, f"{name}: {count} of {trials}"


# --- results, the command, refusals ---


@pytest.mark.slow
def test_a_fit_is_told_on_one_screen_saved_and_drawn(tmp_path: Path) -> None:
    _, h = drainage()
    found = fit_drainage(h * (1 + 1e-3 * noise(10, 40)), free=["eta", "E"], profiles=True)
    lines = str(found).splitlines()
    assert lines[0].startswith("Fit of rognon_gay to curve 1 (h): 40 points, 2 parameters")
    assert len(lines) < 24
    assert "eta" in repr(found)
    assert "+-" in repr(found)
    for ending in (".json", ".npz"):
        again = softdyn.load_result(found.save(tmp_path / f"fit{ending}"))
        assert isinstance(again, softdyn.Fit)
        assert str(again) == str(found)
        np.testing.assert_array_equal(again.covariance, found.covariance)
    with pytest.raises(SceneError, match="a fit is made of data"):
        softdyn.scene_of(again)
    rows = found.save(tmp_path / "fit.csv").read_text().splitlines()
    assert rows[0] == "name,value,error,low,high"
    assert float(rows[1].split(",")[1]) == found.values["eta"]
    assert len(found.plot().axes) == 4


def test_the_command_fits_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, h = drainage()
    data = tmp_path / "film.csv"
    data.write_text("t,h\n" + "\n".join(f"{a!r},{b!r}" for a, b in zip(t.tolist(), h.tolist(), strict=True)))
    scene = tmp_path / "film.toml"
    scene.write_text(
        'law = "rognon_gay"\nparameters = {R = 1.0, E = 1.0, eta = 1.5}\npair = {h = 0.1}\n'
        "drive = {force = 1e-3}\nuntil = {t = 1.0}\n"
    )
    out = tmp_path / "fit.npz"
    assert main(["fit", str(scene), str(data), "--free", "eta", "--no-profiles", "-o", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "eta" in printed
    assert f"wrote {out}" in printed
    found = softdyn.load_result(out)
    assert found.values["eta"] == pytest.approx(1.0, rel=1e-6)  # type: ignore[union-attr]
    assert out.with_suffix(".png").exists()
    told = ["--set", "R=1,E=1", "--set", "eta=1.5,h=0.1", "--drive", "force=1e-3", "--free", "eta", "--no-profiles"]
    assert main(["fit", "rognon_gay", str(data), *told]) == 0
    assert capsys.readouterr().out.splitlines()[2:] == printed.splitlines()[2:3]
    assert main(["fit", "rognon_gay", str(data), "--set", "R"]) == 2
    assert "--set takes NAME=VALUE, not 'R'" in capsys.readouterr().err


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"free": ["etta"]}, "nothing called 'etta' in the scene; did you mean 'eta'"),
    ({"free": "eta"}, "free names what is fitted, a list"),
    ({"drive": None}, "a fit needs a drive, one of force, position, velocity, spring"),
    ({"drive": {"forces": 1.0}}, "drive: unknown 'forces'; did you mean 'force'"),
    ({"drive": {"force": "Z"}}, "unknown name 'Z'"),
    ({"h": None}, "a fit needs h, the gap at the start"),
    ({"h": "1 Pa"}, r"h = '1 Pa' is in Pa, and m is needed"),
    ({"parameters": {**SPHERES, "etta": 1.0}}, "'etta' is not a parameter of the law; did you mean 'eta'"),
    ({"loss": "least"}, "loss must be one of"),
    ({"free": {"eta": (2.5, 3.0)}}, "eta starts at 2, outside of its bounds 2.5 .. 3"),
    ({"parameters": {"R": 1.0}}, "nothing called 'eta'"),
]


@pytest.mark.parametrize(("given", "words"), REFUSED)
def test_what_cannot_be_fitted_is_refused_with_the_remedy(given: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        fit_drainage(drainage()[1], **given)


def test_data_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    t, h = drainage()
    told: dict[str, Any] = {"free": ["eta"], "parameters": SPHERES, "h": 0.1, "drive": {"force": 1e-3}}
    bad = [
        ({"t": t}, "there is nothing to fit"),
        ({"t": t, "h": h[1:]}, "columns are of one length"),
        ({"t": t, "h": np.where(h > 0.05, h, math.nan)}, "one row of finite numbers"),
        ({"h": h}, "there is no column t"),
        ({"t [nm]": t, "h": h}, r"column t: t \[nm\] is in m, and s is needed"),
        ({"t": t, "h [furlong]": h}, "'furlong' is no unit"),
        ({"t": t - 1.0, "h": h}, "shift their times"),
        ({"t": t, "h": h, "h_error": 0 * h}, "standard errors must be positive"),
        ({"t": t[:1], "h": h[:1]}, "points do not determine"),
    ]
    for data, words in bad:
        with pytest.raises(SceneError, match=words):
            softdyn.fit("rognon_gay", data, **told)
    (tmp_path / "bare.csv").write_text("1,2\n2,3\n")
    with pytest.raises(SceneError, match="the first line must name the columns"):
        softdyn.fit("rognon_gay", tmp_path / "bare.csv", **told)


def test_errors_that_are_given_are_taken_as_they_are() -> None:
    t, h = drainage()
    size = 1e-4
    data = {"t": t, "h": h + size * noise(11, 40), "h_error": np.full(40, size)}
    told: dict[str, Any] = {
        "free": ["eta"],
        "parameters": SPHERES,
        "h": 0.1,
        "drive": {"force": 1e-3},
        "profiles": False,
    }
    found = softdyn.fit("rognon_gay", data, **told)
    assert not found.about["estimated"]
    # as a sum of squares of 39 is, but for one time in ten thousand
    assert 14 < found.chi2 < 86
    twice = softdyn.fit("rognon_gay", {**data, "h_error": 2 * data["h_error"]}, **told)
    assert twice.errors["eta"] == pytest.approx(2 * found.errors["eta"], rel=1e-3)
    reach = norm.ppf(0.975) * found.errors["eta"] / found.values["eta"]
    assert math.log(found.intervals["eta"][1] / found.values["eta"]) == pytest.approx(reach, rel=1e-6)


def test_a_parameter_with_a_range_stays_within_it() -> None:
    # data of a law beyond what nu allows: at its bound, and it is said
    x = np.linspace(0.1, 1.0, 20)

    def model(p: Array) -> tuple[Array, Array]:
        return x / (1 - p[0] ** 2), (2 * p[0] * x / (1 - p[0] ** 2) ** 2)[:, None]

    free = [Parameter("nu", 0.3, -1.0, 0.5, by_log=False)]
    found = solve(model, free, 2 * x, np.full(20, 0.01), np.zeros(20, dtype=np.int64))
    assert found.values["nu"] == pytest.approx(0.5, abs=1e-6)
    assert found.at_bounds == ("nu",)
    assert replace(found, at_bounds=()).values["nu"] <= 0.5
