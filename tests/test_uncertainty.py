"""Scenes whose numbers are known as distributions only, and sweeps of fluids."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.rheology.distributions import distribution, read_given, samples_of
from softdyn.rheology.run_table import RunTable
from softdyn.rheology.uncertainty import observed, sobol_indices

PAIR = """
law = "rognon_gay"
parameters = {R = 1.0, E = 1.0, eta = 1.0}
pair.h = 0.1
drive.force = 1e-3
until.h = 0.01
"""
CHANNEL = """
fluid.viscosity = 1.0
mesh = {box = [2.0, 1.0], cells = [4, 4]}
boundary = [{on = "left", pressure = 1.0}, {on = "right", pressure = 0}, {on = ["bottom", "top"], velocity = [0, 0]}]
until.steady = true
"""


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


# ---------------------------------------------------------------- samples


@pytest.mark.parametrize(
    ("text", "at", "value"),
    [
        ("normal(2, 0.5)", 0.8413447460685429, 2.5),  # one standard deviation above
        ("lognormal(2, 1.5)", 0.8413447460685429, 3.0),  # one factor above
        ("uniform(1, 3)", 0.25, 1.5),
        ("loguniform(1, 100)", 0.5, 10.0),
        ("triangular(0, 1, 2)", 0.125, 0.5),
        ("integers(1, 4)", 0.5, 2.0),
    ],
)
def test_distributions_have_the_quantiles_that_their_numbers_say(text: str, at: float, value: float) -> None:
    assert float(distribution(text).ppf(at)) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("normale(1,2)", "did you mean 'normal'"),
        ("normal(1)", "normal takes 2 numbers: mean, standard deviation"),
        ("normal(1,x)", "takes 2 numbers"),
        ("normal(nan,1)", "takes 2 numbers"),
        ("normal(1,-1)", "the standard deviation must be positive"),
        ("lognormal(1,0.5)", "the factor must be more than 1"),
        ("uniform(2,1)", "the first number must be less"),
        ("loguniform(0,1)", "must be positive"),
        ("triangular(0,3,2)", "least, likeliest and largest"),
        ("integers(1.5,2)", "two whole numbers"),
    ],
)
def test_what_is_no_distribution_is_refused(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        distribution(text)


def test_samples_are_balanced_and_made_the_same_again() -> None:
    """Of n points of Sobol's sequence each nth of every parameter's probability holds one."""
    given, n = read_given(["a=normal(0,1)", "b=uniform(-1,1)"]), 64
    samples = samples_of(given, n, 3, sobol=True)
    assert len(samples) == 4 * n
    for name in given:
        for part in (samples[:n], samples[n : 2 * n]):
            share = given[name].cdf([one[name] for one in part])
            assert sorted(np.floor(n * share).astype(int)) == list(range(n))
    # the third set is the first, with a from the second; the fourth with b from it
    assert [one["a"] for one in samples[2 * n : 3 * n]] == [one["a"] for one in samples[n : 2 * n]]
    assert [one["b"] for one in samples[2 * n : 3 * n]] == [one["b"] for one in samples[:n]]
    assert samples == samples_of(given, n, 3, sobol=True)
    assert samples != samples_of(given, n, 4, sobol=True)
    with pytest.raises(SceneError, match=r"a power of two is needed.*: 64"):
        samples_of(given, 60, 1, sobol=False)


def test_indices_are_those_of_a_product_of_lognormal_parameters() -> None:
    """Of y = a/b with log a, log b normal: Var E[y|a]/Var y = (exp(s^2) - 1)/(exp(s^2 + r^2) - 1), by hand."""
    s, r, n = math.log(1.3), math.log(1.5), 4096
    given = read_given(["a=lognormal(2,1.3)", "b=lognormal(1,1.5)"])
    values = np.array([one["a"] / one["b"] for one in samples_of(given, n, 1, sobol=True)])
    found = sobol_indices(values, ["a", "b"], n)
    whole = math.expm1(s**2 + r**2)
    first = {"a": math.expm1(s**2) / whole, "b": math.expm1(r**2) / whole}
    for name, other in (("a", "b"), ("b", "a")):
        for (value, low, high), expected in ((found.first[name], first[name]), (found.total[name], 1 - first[other])):
            assert low < value < high
            # an interval of 95 %, of independent points; these are better spread
            assert low < expected < high
            assert high - low < 0.25


# ---------------------------------------------------------------- commands


@pytest.mark.slow
def test_a_scene_of_two_tells_quantiles_and_by_what_it_varies(tmp_path: Path) -> None:
    """The time of the approach is eta over E times a function of F/(E R^2): with eta alone, as eta is distributed."""
    scene, table = tmp_path / "pair.toml", tmp_path / "t.csv"
    scene.write_text(PAIR)
    command = [
        "uncertainty",
        str(scene),
        "--given",
        "eta=lognormal(1,1.2)",
        "--given",
        "until.h=uniform(0.01,0.0100001)",
    ]
    assert main([*command, "--samples", "8", "--sobol", "-o", str(table)]) == 0
    rows = rows_of(table)
    assert len(rows) == 8 * 4
    ratio = [float(row["t_end"]) / float(row["varied_eta"]) for row in rows]
    # the last gap differs by 1e-5 of itself, and the time by less; rtol is 1e-9
    assert np.ptp(ratio) < 1e-5 * ratio[0]
    quantiles = {row["observable"]: row for row in rows_of(tmp_path / "t.quantiles.csv")}
    drawn = [float(row["t_end"]) for row in rows[:16]]
    assert float(quantiles["t_end"]["q0.5"]) == pytest.approx(np.median(drawn), rel=1e-9)
    indices = {(row["observable"], row["parameter"]): row for row in rows_of(tmp_path / "t.sobol.csv")}
    assert float(indices["t_end", "until.h"]["total"]) < 1e-6
    assert float(indices["t_end", "eta"]["total"]) > 0.1
    assert (tmp_path / "t.png").stat().st_size > 0
    # what is there is not made again
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "t.runs").glob("*.npz")}
    assert main([*command, "--samples", "8", "--sobol", "-o", str(table)]) == 0
    assert made == {path: path.stat().st_mtime_ns for path in made}


@pytest.mark.slow
def test_runs_that_fail_are_told_and_leave_the_indices_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, table = tmp_path / "pair.toml", tmp_path / "t.csv"
    scene.write_text(PAIR)
    command = ["uncertainty", str(scene), "--given", "eta=uniform(-1,3)", "--given", "E=uniform(1,2)", "--samples", "4"]
    assert main([*command, "--sobol", "-o", str(table)]) == 1
    out = capsys.readouterr()
    assert "eta must be positive" in out.err
    assert "indices of Sobol need all" in out.out
    assert not (tmp_path / "t.sobol.csv").exists()
    assert all(float(row["runs"]) < 8 for row in rows_of(tmp_path / "t.quantiles.csv"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--given", "etta=normal(1,0.1)"], "etta is no number of this scene.*did you mean 'eta'"),
        (["--given", "eta=normal(1,0.1)", "--given", "eta=uniform(1,2)"], "eta is given twice"),
        (["--given", "eta"], "NAME=DISTRIBUTION is expected"),
        (["--given", "eta=lognormal(1,1.1)", "--samples", "10"], "a power of two"),
    ],
)
def test_what_cannot_be_sampled_is_refused_before_any_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    scene = tmp_path / "pair.toml"
    scene.write_text(PAIR)
    assert main(["uncertainty", str(scene), *options, "-o", str(tmp_path / "t.csv")]) == 2
    assert re.search(words, capsys.readouterr().err)
    assert not (tmp_path / "t.runs").exists()


@pytest.mark.slow
def test_a_flow_is_swept_and_its_table_is_of_what_it_measures(tmp_path: Path) -> None:
    """Between plates the flux is H^3 dp/(12 eta L): elements whose velocities are parabolas have it to rounding."""
    scene, table = tmp_path / "channel.toml", tmp_path / "t.csv"
    scene.write_text(CHANNEL)
    assert main(["sweep", str(scene), "--vary", "fluid.viscosity=1,4", "-o", str(table)]) == 0
    for row in rows_of(table):
        assert float(row["flux_right"]) * float(row["varied_fluid.viscosity"]) == pytest.approx(1 / 24, rel=1e-10)
        assert float(row["force_top_x"]) == pytest.approx(0.5, rel=1e-10)  # half of the pressure on the inlet


@pytest.mark.slow
def test_a_flow_in_time_tells_means_and_extremes_of_its_second_half(tmp_path: Path) -> None:
    """Stokes flow follows its pressure at once: of 1 + sin(2 pi t) over two periods the mean is 1, extremes 0 and 2."""
    scene, table = tmp_path / "channel.toml", tmp_path / "t.csv"
    pulsed = CHANNEL.replace('"left", pressure = 1.0', '"left", pressure = "1 + sin(2*pi*t)"')
    scene.write_text(pulsed.replace("until.steady = true", "until.t = 2.0\noutput.times = 321"))
    assert main(["sweep", str(scene), "--vary", "fluid.viscosity=1", "-o", str(table)]) == 0
    (row,) = rows_of(table)
    flux = 24 * np.array([float(row[f"flux_right{end}"]) for end in ("", "_min", "_max", "_end")])
    # steps end at output times at least: the mean by trapezoids is off by dt^2 of the curvature, 4 pi^2, over 12; an
    # extreme lies half a step from a value at most, which is off by half of its square
    assert flux == pytest.approx([1, 0, 2, 1], abs=(2 * math.pi * 2 / 320) ** 2 / 8)


def test_what_is_shown_is_a_mean_and_not_its_extremes_too() -> None:
    ramp = np.arange(4.0)
    columns = {"t_end": ramp, "flux": ramp, "flux_min": ramp, "flux_end": ramp, "still": np.ones(4), "drop": ramp}
    table = RunTable({}, columns, {}, (), {}, {"sample": ramp})
    assert observed(table, None) == ["t_end", "flux", "drop"]
    assert observed(table, "flux_min") == ["flux_min"]
    with pytest.raises(SceneError, match="no such column; did you mean 'flux'"):
        observed(table, "flox")
