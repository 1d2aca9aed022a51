"""``softdyn stress``: where it is hard, is the pair engine right, or does it say that it is not.

Every cell of the matrix is a case at a tolerance, compared with a reference computed another way: right within ten
times the tolerance (what the README promises), told, refused, or wrong (:mod:`softdyn.stress.judge`).
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.api import simulate
from softdyn.bench.precise import UNIT
from softdyn.bench.record import heading, write_record
from softdyn.pair.pair_run import ALLOWED_ERROR
from softdyn.results.pair_result import PairResult
from softdyn.results.whole_files import require_folder
from softdyn.stress.far_apart import far_field_cells
from softdyn.stress.judge import OUTCOMES, REFUSED, RIGHT, TOLD, WRONG, Cell, judge, worst
from softdyn.stress.precise_pairs import Case, Reference, cases, references
from softdyn.stress.pulled_pairs import pulled_cells
from softdyn.stress.scenes import random_scenes
from softdyn.stress.units import random_unit_cells, unit_cells
from softdyn.stress.varying import varying_cells

Array = NDArray[np.float64]

RTOLS = (1e-3, 1e-6, 1e-9, 1e-12, 1e-14)
#: Random scenes at default settings; a quarter of them again at a loose tolerance, where errors once grew unseen.
RANDOM_SCENES = 1000
LOOSE = 1e-3


def reference_cells(case: Case, reference: Reference) -> Iterable[Cell]:
    """A case at every tolerance; under a constant push, its outputs at gaps and at times, each way of integrating."""
    for rtol in RTOLS:
        if not case.by_gap:
            yield _at_times(case, rtol, reference.t, reference.h, reference.delta, "auto")
            continue
        gaps = _at_gaps(case, reference, rtol)
        # h at the double next to a time of 30 digits differs from the gap by the rate times what the double lacks
        ill = np.abs(reference.rate) * reference.t * 1.1e-16 > 1e-2
        h = reference.h * np.exp(-reference.rate * reference.t_low)
        known = reference.t[~ill], h[~ill], reference.delta[~ill]
        timed = [_at_times(case, rtol, *known, method) for method in ("auto", "integrate")]
        if case.group == "pull":
            yield replace(gaps, name=f"{case.name}, at gaps")
            yield replace(worst(timed), name=f"{case.name}, at times")
        else:
            yield worst([gaps, *timed])


def _at_times(case: Case, rtol: float, t: Array, h: Array, delta: Array, method: str) -> Cell:
    scale = np.maximum(np.abs(delta), 0.1 * np.max(np.abs(delta)))

    def error(result: PairResult) -> float:
        of_h = np.max(np.abs(result.h / h - 1))
        # a deflection that passes zero has no relative error there: a tenth of the largest serves
        of_delta = np.max(np.abs(result.delta - delta) / scale) if scale.any() else np.max(np.abs(result.delta))
        return float(max(of_h, of_delta))

    scene = {**case.scene, "times": t.tolist(), "until_t": float(t[-1]), "rtol": rtol, "method": method}
    return judge((case.group, case.name, f"{rtol:g}"), lambda: simulate(**scene), error, ALLOWED_ERROR * rtol)


def _at_gaps(case: Case, reference: Reference, rtol: float) -> Cell:
    def error(result: PairResult) -> float:
        of_delta = np.max(np.abs(result.delta / reference.delta - 1))
        return float(max(np.max(np.abs(result.t / reference.t - 1)), of_delta))

    scene = {**case.scene, "gaps": case.at.tolist(), "until_h": case.end, "rtol": rtol}
    return judge((case.group, case.name, f"{rtol:g}"), lambda: simulate(**scene), error, ALLOWED_ERROR * rtol)


def law_cells() -> Iterable[Cell]:
    """Laws whose parameters make them go wrong on the way: there is no solution beyond.

    The proof of signs refuses such a law as it is declared; where it cannot decide, the engine must.
    """
    t = np.linspace(0, 600.0, 13)[1:]
    h, delta = _moved_softening(t)
    zeta = {"law": _vanishing_zeta(), "parameters": {**UNIT, "q": -2.0}, "h": 10.0, "force": 1e-3}
    soft = {"law": _softening(), "parameters": {**UNIT, "q": -120.0}, "h": 1.0}
    pulse = {"force": "0.1*exp(-((t - 50)/20)**2)", "until_t": 100.0, "times": [0.0, 100.0]}
    spring = {"spring": {"stiffness": 1e-4, "base": "3 - t"}, "until_t": 1e3}
    singular = {
        "zeta vanishes on the way, to a gap": {**zeta, "until_h": 0.1},
        "zeta vanishes on the way, to a time": {**zeta, "until_t": 1e9},
        "C changes sign under a force that grows": {**soft, "force": "1e-3*t", "until_t": 1e3},
        "C changes sign in a pulse between two outputs": {**soft, **pulse},
        "C changes sign, held by a soft spring": {**soft, **spring},
    }

    def error(result: PairResult) -> float:
        of_delta = np.max(np.abs(result.delta - delta)) / np.max(np.abs(delta))
        return float(max(np.max(np.abs(result.h / h - 1)), of_delta))

    for rtol in RTOLS:
        column = f"{rtol:g}"
        for name, scene in singular.items():
            yield judge(("law", name, column), partial(simulate, **scene, rtol=rtol), lambda _: math.inf, 0.0)
        moved = partial(simulate, **soft, velocity=-1e-3, until_t=600.0, times=t.tolist(), rtol=rtol)
        # the reference is scipy's, at 1e-13 a step
        where = ("law", "C changes sign while the centres are moved", column)
        yield judge(where, moved, error, max(ALLOWED_ERROR * rtol, 1e-11))


def _vanishing_zeta() -> Any:
    """Friction 6 pi eta R^2/h (1 + q R/(R + h)): where q = -2 it vanishes at h = R."""
    from sympy import Rational, Symbol, pi, sqrt

    from softdyn.derive import DIMENSIONLESS, ContactLaw, E, R, a, delta, eta, h

    q = Symbol("q", real=True)
    law = ContactLaw(
        name="vanishing", a=sqrt(R * (R + h)), F_ela=Rational(4, 9) * E * a * delta,
        zeta=6 * pi * eta * R**2 / h * (1 + q * R / (R + h)), parameters={q: DIMENSIONLESS}, typical={q: 1},
        ranges={q: (0, 2)},
    )  # fmt: skip
    return _beyond_its_range(law)


def _softening() -> Any:
    """F_ela = E R delta (1 + q (delta/R)^2/4): for q = -120 it falls beyond delta = 0.105 R."""
    from sympy import Symbol, pi

    from softdyn.derive import DIMENSIONLESS, ContactLaw, E, R, delta, eta, h

    q = Symbol("q", real=True)
    law = ContactLaw(
        name="softening", a=R, F_ela=E * R * delta * (1 + q * delta**2 / (4 * R**2)), zeta=6 * pi * eta * R**2 / h,
        parameters={q: DIMENSIONLESS}, typical={q: 1}, ranges={q: (0, 2)},
    )  # fmt: skip
    return _beyond_its_range(law)


def _beyond_its_range(law: Any) -> Any:
    """Take a law's ranges away after they were checked: as a law is whose signs nothing could decide."""
    object.__setattr__(law, "ranges", {})
    return law


def _moved_softening(t: Array) -> tuple[Array, Array]:
    """Gap and deflection of the softening law at X = 3 - 1e-3 t, where delta = (h - 1 + 1e-3 t)/2: one unknown."""
    from scipy.integrate import solve_ivp

    def rate(time_: float, u: Array) -> Array:
        h = np.exp(u)
        delta = (h - 1 + 1e-3 * time_) / 2
        return -delta * (1 - 30 * delta**2) / (6 * math.pi)

    found = solve_ivp(rate, (0, t[-1]), [0.0], method="DOP853", rtol=1e-13, atol=1e-14, t_eval=t)
    h = np.exp(found.y[0])
    return h, (h - 1 + 1e-3 * t) / 2


#: What a scene may hold in the place of a number, and what it must not be taken for.
HOSTILE = (5e-324, 1e-310, math.nan, math.inf, -math.inf)
PLAIN: dict[str, Any] = {"law": "rognon_gay", "parameters": UNIT, "h": 1.0, "force": 1e-2, "until_t": 1e3, "times": 3}


def hostile_cells() -> Iterable[Cell]:
    """Denormals, nan and infinity in every input: refused, or as if there stood 0."""
    unforced = {**PLAIN, "force": None}
    inputs: dict[str, Callable[[Any], dict[str, Any]]] = {
        **{name: lambda x, n=name: {**PLAIN, "parameters": {**UNIT, n: x}} for name in UNIT},  # type: ignore[misc]
        "h": lambda x: {**PLAIN, "h": x},
        "X": lambda x: {**PLAIN, "X": x},
        "delta": lambda x: {**unforced, "velocity": -1e-4, "delta": x},
        "force": lambda x: {**PLAIN, "force": x},
        "velocity": lambda x: {**unforced, "velocity": x},
        "position": lambda x: {**unforced, "position": x},
        "stiffness": lambda x: {**unforced, "spring": {"stiffness": x, "base": 2.9}},
        "base": lambda x: {**unforced, "spring": {"stiffness": 1.0, "base": x}},
        "constant": lambda x: {**PLAIN, "force": "1e-2 + c*t", "constants": {"c": x}},
        "start of a sine": lambda x: {**PLAIN, "force": "k*sin(w*t) - c", "constants": {"c": x, "k": 1e-2, "w": 1e-2}},
        "table's time": lambda x: {**PLAIN, "force": ([0.0, x, 2e3], [1e-2, 2e-2, 1e-2])},
        "table's value": lambda x: {**PLAIN, "force": ([0.0, 1e2, 2e3], [1e-2, x, 1e-2])},
        "until t": lambda x: {**PLAIN, "until_t": x},
        "until h": lambda x: {**PLAIN, "until_t": None, "until_h": x},
        "a time": lambda x: {**PLAIN, "times": [x, 1e3]},
        "a gap": lambda x: {**PLAIN, "times": None, "until_t": None, "until_h": 0.5, "gaps": [0.9, x]},
        "rtol": lambda x: {**PLAIN, "rtol": x},
    }
    for name, scene in inputs.items():
        for value in HOSTILE:

            def error(result: PairResult, scene: Callable[[Any], dict[str, Any]] = scene, name: str = name) -> float:
                if name == "until t":
                    return float(np.max(np.abs(result.h - 1)))
                if name == "table's time":  # a jump where the run starts: the first row is never seen
                    twin = simulate(**{**PLAIN, "force": ([0.0, 2e3], [2e-2, 1e-2])})
                    return float(np.max(np.abs(result.h / twin.h - 1)))
                return float(np.max(np.abs(result.h / simulate(**scene(0.0)).h - 1)))

            where = ("hostile", name, f"{value:g}")
            yield judge(where, partial(simulate, **scene(value)), error, 1e-8)
    for rtol in (1e-15, 1e-16, 0.0, -1e-9, 1.0):
        where = ("rtol", "beyond its bounds", f"{rtol:g}")
        yield judge(where, partial(simulate, **PLAIN, rtol=rtol), lambda _: math.inf, 0.0)


def all_cells(say: Callable[[str], None] = lambda _: None) -> list[Cell]:
    """Every cell of the matrix."""
    found: list[Cell] = []
    stored = references()

    def add(cells: Iterable[Cell]) -> None:
        for cell in cells:
            found.append(cell)
            say(f"{cell.group:8} {cell.name:48} {cell.column:9} {cell.outcome:8} {cell.error:.1e} {cell.said[:90]}")

    for case in cases():
        add(reference_cells(case, stored[case.key]))
    for make in (unit_cells, random_unit_cells, varying_cells, pulled_cells):
        add(make(RTOLS))
    for plain in (law_cells, hostile_cells, far_field_cells):
        add(plain())
    return found


def stress(folder: Path, *, scenes: int = RANDOM_SCENES, say: Callable[[str], None] = print) -> dict[str, Any]:
    """Run everything, and write ``stress.json``, ``stress.txt`` and ``stress.png`` into a folder.

    Parameters
    ----------
    folder : Path
        Made, if it is not there.
    scenes : int
        Random scenes at default settings; a quarter as many are run again at a loose tolerance.
    say : function of str
        Is told a line of each cell, and of each random scene that is not right.

    Raises
    ------
    SceneError
        If the folder cannot be written to, which is seen before anything is run.
    """
    require_folder(folder)
    began = time.process_time()
    cells = all_cells(say)
    batches = [random_scenes(scenes, say), random_scenes(scenes // 4, say, LOOSE)]
    report = {
        **heading("softdyn stress", {"numpy": np.__version__}),
        "cpu_s": round(time.process_time() - began),
        "random": batches,
        "cells": [{k: _plain(v) for k, v in asdict(cell).items()} for cell in cells],
    }
    write_record(folder, "stress", report, report_text(report), draw)
    return report


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tally(report: dict[str, Any]) -> Counter[str]:
    """How many cells came out how."""
    return Counter(cell["outcome"] for cell in report["cells"])


def report_text(report: dict[str, Any]) -> str:
    """The matrix as a table: true errors, or what was said instead."""
    total = tally(report)
    random = [
        f"{batch['scenes']} random ordinary scenes at rtol = {batch['rtol']:g}: "
        + ", ".join(f"{batch[outcome]} {outcome}" for outcome in OUTCOMES)
        + f"; largest error {batch['largest_error']:.1e}; estimated over true error {_ratios(batch)}"
        for batch in report["random"]
    ]
    lines = [
        f"softdyn stress, {report['made']}, {report['machine']}, {report['cpu_s']} s of CPU time",
        ", ".join(f"{name} {number}" for name, number in report["versions"].items()),
        "cells: " + ", ".join(f"{total[outcome]} {outcome}" for outcome in OUTCOMES),
        *random,
        "a number is the largest true error of the outputs, relative; right: at most ten times the tolerance;",
        "told: the result itself warns of an error at least as large; refused: an error names the cause",
    ]
    for group in dict.fromkeys(cell["group"] for cell in report["cells"]):
        inside = [cell for cell in report["cells"] if cell["group"] == group]
        columns = list(dict.fromkeys(cell["column"] for cell in inside))
        lines += ["", f"{group:52}" + "".join(f"{column:>11}" for column in columns)]
        for name in dict.fromkeys(cell["name"] for cell in inside):
            row = {cell["column"]: _entry(cell) for cell in inside if cell["name"] == name}
            lines.append(f"  {name:50}" + "".join(f"{row.get(column, ''):>11}" for column in columns).rstrip())
    return "\n".join(lines) + "\n"


def _ratios(batch: dict[str, Any]) -> str:
    """How the estimate of the result compares with the truth, where that is above a tenth of the tolerance."""
    ratios = batch["estimate_over_error"]
    if not ratios["scenes"]:
        return "in no scene that errs by a tenth of that"
    return f"{ratios['least']:.2g} .. {ratios['median']:.2g} .. {ratios['largest']:.2g} in {ratios['scenes']} scenes"


def _entry(cell: dict[str, Any]) -> str:
    if cell["outcome"] in (REFUSED, WRONG) and cell["error"] is None:
        return str(cell["outcome"])
    mark = {RIGHT: "", TOLD: "told ", WRONG: "WRONG "}[cell["outcome"]]
    return f"{mark}{cell['error']:.0e}"


COLOURS = {TOLD: "#f0c75e", REFUSED: "#b9bfc7", WRONG: "#c8322b"}


def draw(report: dict[str, Any]) -> Any:
    """Heat map: green, the deeper the further the true error is below what is allowed."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    groups = {
        group: [cell for cell in report["cells"] if cell["group"] == group]
        for group in dict.fromkeys(cell["group"] for cell in report["cells"])
    }
    left = ["push", "units", "hostile", "rtol", "far field", "far apart"]
    sides = (left, [group for group in groups if group not in left])
    rows = {group: list(dict.fromkeys(cell["name"] for cell in cells)) for group, cells in groups.items()}
    heights = [[len(rows[group]) + 2.5 for group in side if group in rows] for side in sides]
    figure = Figure(figsize=(13, 0.19 * max(map(sum, heights)) + 0.6), layout="constrained")
    green = colormaps["Greens"]
    halves: Any = figure.subfigures(1, 2)
    for half, side, ratios in zip(halves, sides, heights, strict=True):
        present = [group for group in side if group in rows]
        for group, axes in zip(
            present, np.ravel(half.subplots(len(present), 1, height_ratios=ratios, squeeze=False)), strict=True
        ):
            columns = list(dict.fromkeys(cell["column"] for cell in groups[group]))
            for cell in groups[group]:
                x, y = columns.index(cell["column"]), rows[group].index(cell["name"])
                colour: Any = COLOURS.get(cell["outcome"])
                if cell["outcome"] == RIGHT:
                    margin = math.log10(cell["allowed"] / max(cell["error"], 1e-17)) if cell["allowed"] else 0.0
                    colour = green(0.25 + 0.6 * min(max(margin, 0.0), 6.0) / 6.0)
                axes.add_patch(_square(x, y, colour))
                label = "" if cell["error"] is None or group in ("hostile", "rtol") else f"{cell['error']:.0e}"
                axes.text(x + 0.5, y + 0.5, label, ha="center", va="center", fontsize=5.5)
            axes.set(xlim=(0, len(columns)), ylim=(len(rows[group]), 0), title=group)
            axes.title.set_fontsize(9)
            axes.set_xticks(np.arange(len(columns)) + 0.5, columns, fontsize=6)
            axes.set_yticks(np.arange(len(rows[group])) + 0.5, rows[group], fontsize=6)
            axes.tick_params(length=0)
    keys = [Patch(color=green(0.6), label=RIGHT), *(Patch(color=c, label=name) for name, c in COLOURS.items())]
    figure.legend(handles=keys, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _square(x: int, y: int, colour: Any) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", lw=0.8)


def main(folder: Path) -> int:
    """Run and report, progress to stderr; 1 if anything is wrong."""
    report = stress(folder, say=lambda line: print(line, file=sys.stderr))
    print((folder / "stress.txt").read_text(encoding="utf-8"), end="")
    return 1 if tally(report)[WRONG] or any(batch[WRONG] for batch in report["random"]) else 0
