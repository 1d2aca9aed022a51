"""The stress matrix: nothing in it is silently wrong, and what would be is called so."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import softdyn
from softdyn.bench.precise import how_made
from softdyn.errors import IntegrationError
from softdyn.stock import GENERATED
from softdyn.stress import pair_stress as stress
from softdyn.stress import precise_pairs as reference
from softdyn.stress.far_apart import far_field_cells
from softdyn.stress.judge import judge_number
from softdyn.stress.precise_pairs import cases, references
from softdyn.stress.pulled_pairs import functions_of, pulled_cells, table_cells
from softdyn.stress.scenes import random_scenes
from softdyn.stress.units import random_unit_cells
from softdyn.stress.varying import varying_cells

STORED = GENERATED / "stress" / "stress.json"
GROUPS = ("pull", "zero", "jump", "spring", "moved", "film", "snap-in")


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_no_case_is_silently_wrong(group: str) -> None:
    """Against 30 digits, at every tolerance; where no tightening below rounding is asked, right without reserve.

    Among them what once was wrong: on a film whose stiffness grows a thousandfold within a step the error was divided
    by the stiffness of its end alone, and at rtol = 1e-3 outputs were off by 1.4e-2.
    """
    stored = references()
    for case in (case for case in cases() if case.group == group):
        for cell in stress.reference_cells(case, stored[case.key]):
            assert cell.outcome in (stress.RIGHT, stress.TOLD), cell
            assert cell.outcome == stress.RIGHT or "at times" in cell.name or float(cell.column) < 1e-9, cell


def test_a_push_is_right_from_any_gap_to_the_smallest() -> None:
    """From 1e4 R and from 1e-6 R to 1e-15 R; only at 1e-14 may rounding that grows a ten-thousandfold be told of."""
    stored = references()
    for case in cases():
        if case.group == "push" and case.given in (1e-14, 1.0) and case.h0 in (1e4, 1e-6):
            for cell in stress.reference_cells(case, stored[case.key]):
                assert cell.outcome == stress.RIGHT or (cell.outcome == stress.TOLD and cell.column == "1e-14"), cell


@pytest.mark.slow
def test_forces_that_a_few_points_do_not_tell_are_right() -> None:
    """Pulses of 1e-8 of the run, gates and chirps: right, or at 1e-12 and below told, never silently wrong."""
    for cell in varying_cells(stress.RTOLS):
        assert cell.outcome == stress.RIGHT or (cell.outcome == stress.TOLD and float(cell.column) < 1e-9), cell


def test_references_of_constant_forces_are_those_of_the_quadrature() -> None:
    """Of another code, in double precision: some hundred terms of one sign."""
    stored = references()
    for case in cases():
        if case.by_gap and case.h0 in (100.0, 1e-8):
            exact = softdyn.simulate(**case.scene, until_h=case.end, gaps=case.at.tolist(), method="quadrature")
            np.testing.assert_allclose(exact.t, stored[case.key].t, rtol=1e-13)


@pytest.mark.slow
def test_what_has_no_solution_on_the_way_is_refused() -> None:
    """A force beyond the largest that the law can carry was once balanced by a deflection of the other sign."""
    for cell in stress.law_cells():
        right = cell.name == "C changes sign while the centres are moved"
        assert cell.outcome == (stress.RIGHT if right else stress.REFUSED), cell


@pytest.mark.slow
def test_hostile_numbers_are_refused_or_harmless() -> None:
    """A force of 1e-310 once took steps in ln h whose times overflow, and one that starts there, millions of steps."""
    for cell in stress.hostile_cells():
        assert cell.outcome in (stress.RIGHT, stress.REFUSED), cell
        if cell.column in ("nan", "inf", "-inf"):
            assert cell.outcome == stress.REFUSED, cell


def test_particles_in_metres_are_their_dimensionless_twins() -> None:
    for cell in stress.unit_cells(stress.RTOLS):
        assert cell.outcome == stress.RIGHT or float(cell.column) < 1e-12, cell


@pytest.mark.slow
def test_no_result_depends_on_units_drawn_at_random() -> None:
    for cell in random_unit_cells(stress.RTOLS):
        assert cell.outcome == stress.RIGHT or float(cell.column) < 1e-12, cell


@pytest.mark.slow
def test_pulled_films_are_what_their_equations_say_and_near_elastohydrodynamics() -> None:
    cells = list(pulled_cells(stress.RTOLS))
    assert {cell.column for cell in cells} >= {"pulled", "pressed", "1e-14"}
    for cell in cells:
        assert cell.outcome == stress.RIGHT, cell


def test_a_law_that_holds_pulled_films_shut_is_found_wrong() -> None:
    """With abs(delta) a pulled film resists as a pressed one: far from elastohydrodynamics, and called so."""
    cells = {cell.column: cell for cell in table_cells(functions_of("rognon_gay")) if "friction" in cell.name}
    assert cells["pulled"].outcome == stress.WRONG
    assert cells["pulled"].error > 100


@pytest.mark.slow
def test_friction_is_right_from_contact_to_far_apart_with_and_without_drag() -> None:
    for cell in far_field_cells():
        assert cell.outcome == stress.RIGHT, cell


@pytest.mark.slow
def test_random_ordinary_scenes_keep_ten_times_the_default_tolerance() -> None:
    counts = random_scenes(40)
    assert counts["right"] == 40, counts


def test_the_references_say_how_they_are_made() -> None:
    assert json.loads(reference.FILE.read_text(encoding="utf-8"))["how"] == how_made(reference.__doc__)


def test_judgements() -> None:
    """What would be silently wrong is called so, whatever way it goes."""
    good = softdyn.simulate(law="rognon_gay", parameters=stress.UNIT, h=1.0, force=1e-2, until_t=1.0, times=2)
    warned = replace(good, warnings=("the gap is known to 1e-2 only",), stats={**good.stats, "error": 1e-2})

    def outcome(result: softdyn.PairResult, error: float) -> str:
        return stress.judge(("g", "n", "c"), lambda: result, lambda _: error, 1e-6).outcome

    def fail(error: Exception) -> softdyn.PairResult:
        raise error

    assert outcome(good, 1e-6) == stress.RIGHT
    assert outcome(good, 2e-6) == stress.WRONG
    assert outcome(good, float("nan")) == stress.WRONG
    assert outcome(warned, 1e-3) == stress.TOLD
    assert outcome(warned, 2e-2) == stress.WRONG
    for broken in (np.array([1.0, np.nan]), np.array([1.0, -1e-3])):
        assert outcome(replace(good, arrays={**good.arrays, "h": broken}), 0.0) == stress.WRONG
    where = ("g", "n", "c")
    for found, result in ((1.5, stress.RIGHT), (1.52, stress.WRONG), (float("nan"), stress.WRONG)):
        assert judge_number(where, lambda found=found: found, 1.5, 1e-2).outcome == result  # type: ignore[misc]
    for error, expected in ((IntegrationError("no"), stress.REFUSED), (ZeroDivisionError(), stress.WRONG)):
        assert stress.judge(("g", "n", "c"), partial(fail, error), lambda _: 0.0, 1.0).outcome == expected


@pytest.mark.slow
def test_the_stored_report_is_of_the_cases_there_are_and_nothing_in_it_is_wrong(tmp_path: Path) -> None:
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    names = {cell["name"] for cell in stored["cells"]}
    for case in cases():
        assert case.name in names or f"{case.name}, at gaps" in names
    assert {"pulled", "elastohydrodynamics", "units", "far field"} <= {cell["group"] for cell in stored["cells"]}
    assert stress.tally(stored)[stress.WRONG] == 0
    assert all(batch[stress.WRONG] == 0 for batch in stored["random"])
    assert stored["random"][0]["scenes"] >= 1000
    assert stored["random"][0]["rtol"] == softdyn.Scene.rtol
    assert STORED.with_name("stress.txt").read_text(encoding="utf-8") == stress.report_text(stored)
    figure = stress.draw(stored)
    figure.savefig(tmp_path / "stress.png")
    assert (tmp_path / "stress.png").stat().st_size > 10_000
