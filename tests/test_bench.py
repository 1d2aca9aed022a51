"""The benchmark: its references, and that it reports what was measured, reached or not."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest

import softdyn
from softdyn.bench import batch_times as bench_batch
from softdyn.bench import pair_bench as bench
from softdyn.bench import precise_cases as reference
from softdyn.bench.precise import how_made
from softdyn.bench.precise_cases import Case, cases
from softdyn.bench.rule_times import kernels_by_rule
from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.kernels import get_kernel
from softdyn.pair.pair_run import kernel_needs
from softdyn.scene.pair_drive import drive_of
from softdyn.stock import GENERATED

STORED = GENERATED / "bench" / "bench.json"


@pytest.mark.parametrize("case", [case for case in cases() if case.drive == "constant"], ids=lambda case: case.name)
def test_references_are_those_of_the_quadrature(case: Case) -> None:
    """In double precision, so to rounding: of the sum for t, through the rate, and of exp(10 - h/lam) near a film."""
    moving = np.abs(case.h / 1e-4 - 1) > 1e-3 if case.film else np.full(len(case.h), True)
    exact = softdyn.simulate(
        law=case.law, parameters=case.parameters, h=case.h0, **case.given, until_h=float(case.h[moving][-1]),
        gaps=case.h[moving].tolist(), method="quadrature", quantities=("dh_dt",),
    )  # fmt: skip
    error = np.abs((exact.t - case.t[moving]) * exact.dh_dt / exact.h)
    assert error.max() < (1e-12 if case.film else 5e-14)
    np.testing.assert_allclose(exact.delta, case.delta[moving], rtol=1e-14)
    # at rest, where F_adh balances the force, to the rounding of A exp(-10)
    np.testing.assert_allclose(case.h[~moving], 1e-4, rtol=1e-3)
    if case.film:
        assert abs(case.h[-1] / 1e-4 - 1) < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("target", ["c", pytest.param("numba", marks=pytest.mark.slow)])
def test_the_engine_reaches_every_reference(target: str) -> None:
    """Ten times the tolerance in ln h covers the steps, and what the sine does to early errors."""
    for case in cases():
        solve = bench._ours(case, target, "auto")
        for rtol in (1e-6, 1e-10, 1e-13):
            assert bench._true_error(case, *solve(rtol)) < 10 * rtol + 1e-14, (case.name, rtol)


@pytest.mark.slow
def test_the_batch_reaches_its_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times at given gaps by quadrature, against gaps at these times: to rounding of t through the rate."""
    monkeypatch.setattr(bench_batch, "RUNS", 40)
    monkeypatch.setattr(bench_batch, "COMPARED", 40)
    forces, times, deltas, gaps = bench_batch.reference()
    solve = bench_batch._ours("c", forces, times)
    for rtol in (1e-6, 1e-9, 1e-12):
        assert bench_batch.error_of(solve(rtol), deltas, gaps) < 10 * rtol


@pytest.mark.slow
def test_a_kernel_without_rules_gives_the_same_numbers() -> None:
    """Rules leave out what a scene does not need, and change nothing else but groupings."""
    case = next(case for case in cases() if case.name == "constant, kappa = 0.01")
    scene = bench._scene(case, "c", "auto")
    drive = drive_of(scene)
    needs = kernel_needs(scene, drive)
    kernel = get_kernel(scene.law, "c", **needs)
    operations = {}
    for variant, made, count in kernels_by_rule(scene.law, kernel, needs):
        scene_of = replace(scene, parameters={name: scene.parameters[name] for name in made.parameters})
        assert bench._true_error(case, *bench._runs(case, scene_of, drive, made)(1e-10)) < 1e-9, variant
        operations[variant] = count
    assert operations["as it is"] == min(count for name, count in operations.items() if not name.startswith("with "))
    assert operations["without any"] == max(operations.values())


def run(integrator: str, error: float, cpu_s: float) -> dict[str, object]:
    return {"case": "sine", "integrator": integrator, "tolerance": error, "error": error, "cpu_s": cpu_s}


REPORT = {
    "made": "2000-01-01",
    "machine": "none",
    "versions": {"heyoka": "1", "numbalsoda": "not installed"},
    "missing": {"numbalsoda": "not installed"},
    "cases": {"sine": "a force"},
    "runs": [
        run("softdyn, c", 1e-7, 10e-6),
        run("softdyn, c", 1e-11, 40e-6),
        run("heyoka", 1e-9, 20e-6),
        run("heyoka, gap as variable", 1e-12, 1e-9),
    ],
}


def test_the_time_to_an_error_is_the_least_that_reaches_it() -> None:
    times = bench.least_times(REPORT, "sine")
    assert times["softdyn, c"] == [10e-6, 40e-6, 40e-6, math.inf]
    assert times["heyoka"] == [20e-6, 20e-6, math.inf, math.inf]


def test_the_table_names_what_is_missing_and_sets_ratios_against_goals() -> None:
    lines = bench.report_text(REPORT).splitlines()
    assert "missing: numbalsoda: not installed" in lines
    ratios = next(line for line in lines if "ours over the fastest peer" in line)
    # a peer that was given our formulation is no peer; where one of the two falls short there is no ratio
    assert ratios.split()[-4:] == ["0.50", "2.00", "-", "-"]
    assert next(line for line in lines if line.strip().startswith("goal")).split()[-4:] == [
        "0.60",
        "0.80",
        "0.90",
        "1.00",
    ]


def test_the_references_say_how_they_are_made() -> None:
    assert json.loads(reference.FILE.read_text(encoding="utf-8"))["how"] == how_made(reference.__doc__)


@pytest.mark.slow
def test_the_report_draws(tmp_path: Path) -> None:
    figure = bench.draw(REPORT)
    figure.savefig(tmp_path / "bench.png")
    assert (tmp_path / "bench.png").stat().st_size > 1000
    assert [axes.get_title() for axes in figure.axes] == list(REPORT["cases"])


def test_an_integrator_has_one_colour_in_all_diagrams_and_one_entry_in_the_legend() -> None:
    figure = bench.draw(json.loads(STORED.read_text(encoding="utf-8")))
    (legend,) = figure.legends
    entries = [line.get_color() for line in legend.get_lines()]
    assert len(entries) == len(set(entries)) > 5
    assert {line.get_color() for axes in figure.axes for line in axes.get_lines()} == set(entries)


def test_the_stored_report_is_of_the_cases_there_are() -> None:
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    assert stored["cases"] == {**{case.name: case.about for case in cases()}, "batch": bench_batch.ABOUT}
    text = STORED.with_name("bench.txt").read_text(encoding="utf-8")
    assert text == bench.report_text(stored)


def test_a_folder_that_cannot_be_made_is_an_error_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setattr(bench, "cases", lambda: pytest.fail("something was measured"))
    with pytest.raises(SceneError, match="cannot write to the folder"):
        bench.bench(tmp_path / "file")


@pytest.fixture
def few_cases(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Two integrators on one case, as quick as can be; the list holds how many runs there are before an interrupt."""
    case, left = cases()[0], [10**6]

    def solve(tolerance: float) -> tuple[np.ndarray, np.ndarray]:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return case.h * (1 + tolerance), case.delta

    monkeypatch.setattr(bench, "cases", lambda: [case])
    monkeypatch.setattr(
        bench, "_integrators", lambda *_: [(f"softdyn, {k}", lambda: solve, [1e-6, 1e-8]) for k in "cd"]
    )
    monkeypatch.setattr(bench, "_batch", lambda *_: None)
    monkeypatch.setattr(bench, "worth_of_specialisation", lambda *_: [])
    monkeypatch.setattr(bench, "_cpu_time", lambda call, *_: call() and 1e-6)
    return left


def test_what_was_measured_before_an_interrupt_is_kept(
    few_cases: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """And told; a report that was whole before stays whole."""
    (tmp_path / "bench.json").write_text("an earlier one")
    few_cases[0] = 7  # two for each row: the error, and the time
    assert main(["bench", "-o", str(tmp_path)]) == 130
    said = capsys.readouterr().err
    assert f"interrupted; what it has measured is in {tmp_path / 'bench.partial.txt'}" in said
    kept = json.loads((tmp_path / "bench.partial.json").read_text(encoding="utf-8"))
    assert [(run["integrator"], run["tolerance"]) for run in kept["runs"]] == [
        ("softdyn, c", 1e-6), ("softdyn, c", 1e-8), ("softdyn, d", 1e-6),
    ]  # fmt: skip
    text = (tmp_path / "bench.partial.txt").read_text(encoding="utf-8")
    assert "PARTIAL: stopped before all was measured" in text
    assert text.count("not measured") == 1, "the batch"
    assert (tmp_path / "bench.json").read_text() == "an earlier one"


def test_a_report_that_is_whole_leaves_no_partial_one(few_cases: list[int], tmp_path: Path) -> None:
    report = bench.bench(tmp_path, say=lambda _: None)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bench.json", "bench.png", "bench.txt"]
    assert "partial" not in report
    assert "PARTIAL" not in (tmp_path / "bench.txt").read_text(encoding="utf-8")


def test_a_bench_of_particles_keeps_what_it_has_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from softdyn.particles import step_times as of_particles

    row = {"particles": 1.0, "contacts": 2.0, "seconds": 3.0, "wall": 4.0, "iterations": 5.0, "peak": 6e6}
    rows = iter([row, {**row, "particles": 7.0}])

    def time_step(*_: object, **__: object) -> dict[str, float]:
        try:
            return next(rows)
        except StopIteration:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(of_particles, "time_step", time_step)
    assert main(["bench", "particles", "-o", str(tmp_path)]) == 130
    said = capsys.readouterr()
    assert f"what it has measured is in {tmp_path / 'particles.partial.txt'}" in said.err
    lines = (tmp_path / "particles.partial.txt").read_text(encoding="utf-8").splitlines()
    assert lines[1] == "PARTIAL: not all is measured"
    assert lines[2:] == said.out.splitlines()
    assert [line.split()[2] for line in lines[2:]] == ["1", "7"]


def test_what_is_missing_says_how_it_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(bench, "version", version)
    missing: dict[str, str] = {}
    bench._integrators(cases()[0], missing)
    assert set(missing) == {"heyoka", "numbalsoda"}
    assert missing["heyoka"] == "not installed (pip install 'softdyn[bench]')"
    assert "pip install 'softdyn[bench-fortran]', where there are a Fortran compiler" in missing["numbalsoda"]


def test_what_installs_the_peers_needs_no_fortran_compiler() -> None:
    """One package without wheels makes the whole of an extra fail."""
    extras = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    assert extras["bench"] == ["heyoka"]
    assert "numbalsoda" in extras["bench-fortran"]
