"""Work against precision: the pair engine and its peers, by true error and CPU time per trajectory.

Every integrator is run over a ladder of tolerances; each run is a pair (largest true error, in h and in delta, over all
outputs; CPU time of a trajectory, compiling apart). The time to an error is the least over the runs that reach it.
Peers integrate (ln h, delta) in t; where softdyn takes the gap as the independent variable, a row gives a peer the
same.
"""

from __future__ import annotations

import itertools
import math
import sys
import textwrap
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.bench import batch_times as batch
from softdyn.bench.precise_cases import Case, cases
from softdyn.bench.record import forget, heading, keep, write_record
from softdyn.kernels import Kernel, get_kernel
from softdyn.pair.batch import STATES
from softdyn.pair.pair_run import MOST_STEPS, kernel_needs, kernel_parameters
from softdyn.pair.states import initial_deflection
from softdyn.results.whole_files import require_folder
from softdyn.scene.pair_drive import Drive, drive_of
from softdyn.scene.pair_scene import Scene

Array = NDArray[np.float64]
Solve = Callable[[float], tuple[Array, Array]]

TARGET_ERRORS = (1e-6, 1e-8, 1e-10, 1e-12)
#: What the project sets out to reach: our time over the fastest peer's, at each of the errors above.
GOALS = {
    "constant": (0.25, 0.25, 0.25, 0.25),
    "sine": (0.6, 0.8, 0.9, 1.0),
    "film": (0.4, 0.5, 0.5, 0.7),
    "batch": (0.3, 0.3, 0.3, 0.3),
}
#: What stands between these and the ratios, by profiles of the C kernel: said where a goal is not reached.
LIMITS = {
    "constant": "nearly half is the call from Python; of the rest more than half is the 50 outputs, each an inversion "
    "of the time's polynomial and a force balance",
    "sine": "steps no longer than the dense output, of order 9, allows; in each, two to three passes of Newton's "
    "iteration over 8 force balances, rates and slopes, and a matrix of 8 rows",
    "batch": "more than half is the 50 outputs, each an inversion of the time's polynomial and a force balance",
}
PEERS = ("heyoka", "numbalsoda", "scipy", "numba")
INSTALLED_BY = {
    "heyoka": "'softdyn[bench]'",
    "numbalsoda": "'softdyn[bench-fortran]', where there are a Fortran compiler and CMake",
}


@dataclass(frozen=True)
class Run:
    """One integrator at one tolerance on one case."""

    case: str
    integrator: str
    tolerance: float
    error: float
    cpu_s: float


def bench(
    folder: Path, *, repeats: int = 5, seconds: float = 0.05, say: Callable[[str], None] = print
) -> dict[str, Any]:
    """Measure everything, and write ``bench.json``, ``bench.txt`` and ``bench.png`` into a folder.

    What is measured is kept as it comes, in ``bench.partial.json`` and ``bench.partial.txt``, until all is there.

    Parameters
    ----------
    folder : Path
    repeats : int
        Times are medians over so many measurements.
    seconds : float
        CPU time that one measurement lasts at least.
    say : function of a line of text

    Raises
    ------
    SceneError
        If the folder cannot be written to, which is seen before anything is measured.
    """
    require_folder(folder)
    missing: dict[str, str] = {}
    report: dict[str, Any] = {
        **heading("softdyn bench", _versions()),
        "partial": True,
        "missing": missing,
        "cases": {**{case.name: case.about for case in cases()}, "batch": batch.ABOUT},
        "specialisation": [],
        "runs": [],
    }

    def measured(run: Run) -> None:
        report["runs"].append(vars(run))
        say(f"{run.case:16} {run.integrator:28} {run.tolerance:.0e}  error {run.error:.1e}  {run.cpu_s * 1e6:10.1f} us")
        keep(folder, "bench", report, report_text(report))

    for case in cases():
        for integrator, make, tolerances in _integrators(case, missing):
            try:
                solve = make()
            except Exception as failed:  # a peer's own way to fail: reported, with its words
                missing[f"{integrator}, {case.name}"] = f"{type(failed).__name__}: {failed}"
                continue
            for tolerance in tolerances:
                try:
                    error = _true_error(case, *solve(tolerance))
                except Exception as failed:
                    say(f"{case.name:16} {integrator:28} {tolerance:.0e}  failed: {failed}")
                    continue
                cpu = _cpu_time(partial(solve, tolerance), repeats, seconds)
                measured(Run(case.name, integrator, tolerance, error, cpu))
    _batch(missing, repeats, measured)
    report["specialisation"] = worth_of_specialisation(repeats, seconds)
    del report["partial"]
    text = report_text(report)
    say("\n" + text)
    write_record(folder, "bench", report, text, draw)
    forget(folder, "bench")
    return report


def _batch(missing: dict[str, str], repeats: int, measured: Callable[[Run], None]) -> None:
    """Many approaches at once, ours and the one peer that makes batches."""
    forces, times, deltas, gaps = batch.reference()
    for integrator, make, tolerances in batch.integrators(forces, times, deltas):
        try:
            solve = make()
        except Exception as failed:
            missing[f"{integrator}, batch"] = f"{type(failed).__name__}: {failed}"
            continue
        for tolerance in tolerances:
            error = batch.error_of(solve(tolerance), deltas, gaps)
            cpu = _cpu_time(partial(solve, tolerance), repeats, 0.0) / batch.RUNS
            measured(Run("batch", integrator, tolerance, error, cpu))


def worth_of_specialisation(repeats: int, seconds: float) -> list[dict[str, Any]]:
    """Operations of the law and CPU time per run at rtol = 1e-8, in seconds, for kernels with fewer rules, in C."""
    from softdyn.bench.rule_times import kernels_by_rule

    rows: dict[str, dict[str, Any]] = {}
    for column, name in (("constant", "constant, kappa = 0.01"), ("sine", "sine")):
        case = next(case for case in cases() if case.name == name)
        scene = _scene(case, "c", "auto")
        drive = drive_of(scene)
        needs = kernel_needs(scene, drive)
        kernel = get_kernel(scene.law, "c", **needs)
        for variant, made, operations in kernels_by_rule(scene.law, kernel, needs):
            of_variant = replace(scene, parameters={key: scene.parameters[key] for key in made.parameters})
            solve = _runs(case, of_variant, drive, made)
            row = rows.setdefault(variant, {"kernel": variant, "operations": {}})
            row["operations"][column] = operations
            row[column] = _cpu_time(partial(solve, 1e-8), repeats, seconds)
    return list(rows.values())


def _versions() -> dict[str, str]:
    found = {}
    for name in PEERS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _cpu_time(call: Callable[[], Any], repeats: int, seconds: float) -> float:
    """Median CPU time of a call, over measurements of many calls each."""
    start = time.process_time()
    call()
    once = max(time.process_time() - start, 1e-7)
    number = max(1, math.ceil(seconds / once))
    measured = []
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(number):
            call()
        measured.append((time.process_time() - start) / number)
    return float(np.median(measured))


def _true_error(case: Case, h: Array, delta: Array) -> float:
    """Largest relative error, of h and of delta, over all outputs; infinite where one is no number."""
    error = max(np.max(np.abs(h / case.h - 1)), np.max(np.abs(delta - case.delta) / case.scale))
    return float(error) if math.isfinite(error) else math.inf


def _integrators(case: Case, missing: dict[str, str]) -> list[tuple[str, Callable[[], Solve], Sequence[float]]]:
    """Name, maker and tolerances of all that is installed; what is not, is noted."""
    ours = [10.0**-k for k in range(4, 15)]
    found: list[tuple[str, Callable[[], Solve], Sequence[float]]] = [
        (f"softdyn, {target}", partial(_ours, case, target, "auto"), ours) for target in ("c", "numba")
    ]
    if case.drive == "constant":
        found.append(("softdyn, c, in time", lambda: _ours(case, "c", "integrate"), ours))
    for name in ("heyoka", "numbalsoda"):
        try:
            version(name)
        except PackageNotFoundError:
            missing[name] = f"not installed (pip install {INSTALLED_BY[name]})"
            continue
        if name == "heyoka":
            found.append(("heyoka", lambda: _heyoka(case), [10.0**-k for k in range(5, 16)]))
            if case.drive == "constant" and not case.film:
                found.append(
                    ("heyoka, gap as variable", lambda: _heyoka_by_gap(case), [10.0**-k for k in range(5, 16)])
                )
        else:
            found.append(("numbalsoda, LSODA", lambda: _numbalsoda(case), [10.0**-k for k in range(5, 14)]))
    for method in ("LSODA", "Radau") if case.film else ("LSODA", "DOP853", "Radau"):
        for compiled in (False, True):
            name = f"scipy, {method}, {'numba' if compiled else 'python'}"
            found.append((name, partial(_scipy, case, method, compiled), [10.0**-k for k in (5, 7, 9, 11, 13)]))
    return found


def _ours(case: Case, target: str, method: str) -> Solve:
    """The engine itself: integration and outputs, in one call; scene files and results apart."""
    scene = _scene(case, target, method)
    drive = drive_of(scene)
    kernel: Kernel = get_kernel(scene.law, target, **kernel_needs(scene, drive))
    return _runs(case, scene, drive, kernel)


def _scene(case: Case, target: str, method: str) -> Scene:
    return Scene(
        law=case.law, parameters=case.parameters, h=case.h0, **case.given, constants=case.constants,
        until_t=float(case.t[-1]), target=target, method=method,
    )  # fmt: skip


def _runs(case: Case, scene: Scene, drive: Drive, kernel: Kernel) -> Solve:
    """One run of a kernel, as a batch of one."""
    p = kernel_parameters(scene, kernel, drive)
    delta0 = initial_deflection(scene, kernel, drive, p, float(case.parameters["R"]))
    end, outputs = float(case.t[-1]), len(case.t)
    row = np.concatenate([[end, math.nan, math.log(case.h0), delta0], p, *drive.arguments])
    out = np.empty((STATES + len(kernel.outputs)) * outputs + 2)

    def solve(tolerance: float) -> tuple[Array, Array]:
        settings = np.array([tolerance, 0.0, math.inf, float(MOST_STEPS), float(scene.method == "auto")])
        kernel.functions.runs(1, outputs, 0, settings, row, case.t, out)
        return out[outputs : 2 * outputs], out[2 * outputs : 3 * outputs]

    return solve


def _heyoka_rates(case: Any) -> tuple[Any, Any, Any, Any]:
    """Return d(ln h)/dt and d(delta)/dt as heyoka's expressions, and the two variables."""
    import heyoka as hy

    u, delta = hy.make_vars("u", "delta")
    h = hy.exp(u)
    bar = h / (1.0 + h)
    if case.drive == "velocity":
        # an event changes the sign where delta does
        a2 = 2.0 * (bar + hy.par[0] * delta)
        w = case.constants["w"]
        moved = -case.constants["D"] * w * hy.cos(w * hy.time)
        h_dot = -4 / 9 * hy.sqrt(a2) * delta / (1.5 * math.pi * a2 * a2 / (bar * bar * bar))
        return h_dot / h, 0.5 * (h_dot - moved), u, delta
    a2 = 2.0 * (bar + delta)
    a = hy.sqrt(a2)
    F: Any = case.kappa
    F_dot: Any = 0.0
    if case.drive == "sine":
        w = case.constants["w"]
        F = case.kappa * (1.0 + 0.5 * hy.sin(w * hy.time))
        F_dot = 0.5 * case.kappa * w * hy.cos(w * hy.time)
    zeta = 1.5 * math.pi * a2 * a2 / (bar * bar * bar)
    net = F - (case.parameters["A"] * hy.exp(-h / case.parameters["lam"])) if case.film else F
    h_dot = -net / zeta
    F_h = 4 / 9 * delta / a / ((1.0 + h) * (1.0 + h))
    F_delta = 4 / 9 * (a + delta / a)
    return h_dot / h, (F_dot - F_h * h_dot) / F_delta, u, delta


def _heyoka(case: Case) -> Solve:
    import heyoka as hy

    u_dot, delta_dot, u, delta = _heyoka_rates(case)
    made: dict[float, Any] = {}
    grid = [0.0, *case.t.tolist()]
    more: dict[str, Any] = {}

    def pulled(engine: Any, sign: int) -> bool:
        engine.pars[0] = -1.0
        return True

    if case.drive == "velocity":
        crossing = hy.t_event(delta, direction=hy.event_direction.negative, callback=pulled)
        more = {"pars": [1.0], "t_events": [crossing]}

    def solve(tolerance: float) -> tuple[Array, Array]:
        if tolerance not in made:
            made[tolerance] = hy.taylor_adaptive([(u, u_dot), (delta, delta_dot)], [0.0, 0.0], tol=tolerance, **more)
        engine = made[tolerance]
        if more:
            engine.pars[0] = 1.0
            engine.reset_cooldowns()
        engine.time = 0.0
        engine.state[:] = math.log(case.h0), case.delta0
        found = engine.propagate_grid(grid)[-1]
        return np.exp(found[1:, 0]), found[1:, 1]

    return solve


def _heyoka_by_gap(case: Case) -> Solve:
    """Time and delta against s = -ln h; each step's Taylor series is inverted for the outputs within it."""
    import heyoka as hy
    import numba

    u_dot, delta_dot, _, delta = _heyoka_rates(case)
    # the independent variable is s = -ln h, heyoka's time
    t = hy.make_vars("t")
    here = {"u": -hy.time}
    t_rate = hy.subs(-1.0 / u_dot, here)
    delta_rate = hy.subs(-delta_dot / u_dot, here)
    made: dict[float, Any] = {}

    @numba.njit
    def invert(series, step, start, times, first, h, delta):  # type: ignore[no-untyped-def]
        """Outputs within a step, by Newton's iteration on the series of t; returns the number of the next one."""
        order = series.shape[1] - 1
        end = 0.0
        for k in range(order, -1, -1):
            end = end * step + series[0, k]
        x = 0.0
        while first < len(times) and times[first] <= end:
            for _ in range(20):
                value, slope = series[0, order], 0.0
                for k in range(order - 1, -1, -1):
                    slope = slope * x + value
                    value = value * x + series[0, k]
                change = (value - times[first]) / slope
                x -= change
                if abs(change) <= 1e-9:
                    break
            value = series[1, order]
            for k in range(order - 1, -1, -1):
                value = value * x + series[1, k]
            h[first], delta[first] = math.exp(-(start + x)), value
            first += 1
        return first

    def solve(tolerance: float) -> tuple[Array, Array]:
        if tolerance not in made:
            made[tolerance] = hy.taylor_adaptive([(t, t_rate), (delta, delta_rate)], [0.0, 0.0], tol=tolerance)
        engine = made[tolerance]
        engine.time = -math.log(case.h0)
        engine.state[:] = 0.0, case.delta0
        h, deltas = np.empty(len(case.t)), np.empty(len(case.t))
        found = 0
        while found < len(case.t):
            start = engine.time
            _, step = engine.step(write_tc=True)
            found = invert(engine.tc, step, start, case.t, found, h, deltas)
        return h, deltas

    return solve


def _rates(case: Case, decorate: Callable[[Any], Any]) -> Callable[..., Any]:
    """Rates of (ln h, delta) in plain Python, for scipy; ``decorate`` may compile them."""
    kappa, w, film = case.kappa, case.constants.get("w", 0.0), case.film
    A, lam = case.parameters.get("A", 0.0), case.parameters.get("lam", 1.0)
    moved, depth = case.drive == "velocity", case.constants.get("D", 0.0)

    def rates(t: float, y: Array) -> Array:
        h = math.exp(y[0])
        bar = h / (1.0 + h)
        a2 = 2.0 * (bar + abs(y[1]))
        a = math.sqrt(a2)
        if moved:
            h_dot = -4 / 9 * a * y[1] / (1.5 * math.pi * a2 * a2 / bar**3)
            return np.array([h_dot / h, 0.5 * (h_dot + depth * w * math.cos(w * t))])
        F = kappa * (1.0 + 0.5 * math.sin(w * t))
        F_dot = 0.5 * kappa * w * math.cos(w * t)
        net = F - A * math.exp(-h / lam) if film else F
        h_dot = -net / (1.5 * math.pi * a2 * a2 / bar**3)
        F_h = 4 / 9 * y[1] / a / (1.0 + h) ** 2
        F_delta = 4 / 9 * (a + abs(y[1]) / a)
        return np.array([h_dot / h, (F_dot - F_h * h_dot) / F_delta])

    decorated: Callable[..., Any] = decorate(rates)
    return decorated


def _scipy(case: Case, method: str, compiled: bool) -> Solve:
    from scipy.integrate import solve_ivp

    if compiled:
        import numba

        rates = _rates(case, numba.njit)
        rates(0.0, np.array([0.0, 0.1]))
    else:
        rates = _rates(case, lambda function: function)
    start = [math.log(case.h0), case.delta0]

    def solve(tolerance: float) -> tuple[Array, Array]:
        found = solve_ivp(
            rates, (0.0, case.t[-1]), start, method=method, t_eval=case.t, rtol=max(tolerance, 3e-14),
            atol=[tolerance, tolerance * float(case.scale.min())],
        )  # fmt: skip
        if not found.success:
            raise RuntimeError(found.message)
        return np.exp(found.y[0]), found.y[1]

    return solve


def _numbalsoda(case: Case) -> Solve:
    """LSODA without Python in the loop."""
    import numba
    from numbalsoda import lsoda, lsoda_sig

    rates = _rates(case, numba.njit)

    @numba.cfunc(lsoda_sig)
    def right_hand_side(t, u, du, p):  # type: ignore[no-untyped-def]
        found = rates(t, numba.carray(u, (2,)))
        du[0] = found[0]
        du[1] = found[1]

    address = right_hand_side.address
    start, grid = np.array([math.log(case.h0), case.delta0]), np.concatenate([[0.0], case.t])

    def solve(tolerance: float) -> tuple[Array, Array]:
        found, success = lsoda(address, start, grid, rtol=tolerance, atol=tolerance * float(case.scale.min()))
        if not success:
            raise RuntimeError("LSODA failed")
        return np.exp(found[1:, 0]), found[1:, 1]

    return solve


def least_times(report: dict[str, Any], case: str) -> dict[str, list[float]]:
    """Per integrator, the least CPU time in seconds to each of the target errors; infinite where none is reached."""
    runs = [run for run in report["runs"] if run["case"] == case]
    names = dict.fromkeys(run["integrator"] for run in runs)
    return {
        name: [
            min((r["cpu_s"] for r in runs if r["integrator"] == name and r["error"] <= target), default=math.inf)
            for target in TARGET_ERRORS
        ]
        for name in names
    }


def is_peer(integrator: str) -> bool:
    """Whether an integrator is a peer's, in its own formulation, and not ours or one that was given ours."""
    return not integrator.startswith("softdyn") and "gap as variable" not in integrator


def report_text(report: dict[str, Any]) -> str:
    """Tables of times, and of our time over the fastest peer's with the goal."""
    lines = [
        f"softdyn bench, {report['made']}, {report['machine']}",
        *(["PARTIAL: stopped before all was measured"] if report.get("partial") else []),
        ", ".join(f"{name} {number}" for name, number in report["versions"].items()),
        *(f"missing: {name}: {why}" for name, why in report["missing"].items()),
        "CPU time per trajectory in microseconds to a true error, in h and in delta at every output, of at most",
    ]
    for case, about in report["cases"].items():
        head = "".join(f"{target:>10.0e}" for target in TARGET_ERRORS)
        lines += ["", f"{case}: {about}", f"    {'':28}{head}"]
        times = least_times(report, case)
        if not times:
            lines.append("    not measured")
            continue
        for name, values in times.items():
            lines.append(
                f"    {name:28}" + "".join(f"{v * 1e6:10.1f}" if math.isfinite(v) else f"{'-':>10}" for v in values)
            )
        ours = times.get("softdyn, c", [math.inf] * 4)
        of_peers = [values for name, values in times.items() if is_peer(name)] or [[math.inf] * len(ours)]
        peers = [min(values) for values in zip(*of_peers, strict=True)]
        ratios = [
            a / b if math.isfinite(a) and math.isfinite(b) else math.nan for a, b in zip(ours, peers, strict=True)
        ]
        lines.append(
            f"    {'ours over the fastest peer':28}" + "".join(f"{r:10.2f}" if r == r else f"{'-':>10}" for r in ratios)
        )
        goal = GOALS.get(case.split(",")[0])
        if goal:
            lines.append(f"    {'goal':28}" + "".join(f"{g:10.2f}" for g in goal))
            limit = LIMITS.get(case.split(",")[0])
            if limit and not all(ratio <= aim for ratio, aim in zip(ratios, goal, strict=True)):
                lines += textwrap.wrap(f"what limits it: {limit}", 110, initial_indent="    ", subsequent_indent="    ")
    table = report.get("specialisation", [])
    if table:
        lines += ["", "What each rule of specialisation is worth: without it, operations of the law and CPU time"]
        columns = ("constant", "sine")
        lines.append(f"    {'':32}" + "".join(f"{name:>26}" for name in columns))
        for row in table:
            cells = [f"{row['operations'][name]}, {row[name] * 1e6:.1f} us" if name in row else "-" for name in columns]
            lines.append(f"    {row['kernel']:32}" + "".join(f"{cell:>26}" for cell in cells))
    return "\n".join(lines) + "\n"


def draw(report: dict[str, Any]) -> Any:
    """Work-precision diagrams, one for each case; each integrator has one colour in all of them."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    names = list(report["cases"])
    columns = min(3, len(names))
    rows = math.ceil(len(names) / columns)
    integrators = list(dict.fromkeys(run["integrator"] for run in report["runs"]))
    pairs = colormaps["tab20"].colors  # type: ignore[attr-defined]
    colours = dict(zip(integrators, itertools.cycle(pairs[::2] + pairs[1::2]), strict=False))
    lines = {}
    figure = Figure(figsize=(3.6 * columns, 3.2 * rows + 1.1), layout="constrained")
    for axes, case in zip(figure.subplots(rows, columns, squeeze=False).flat, names, strict=False):
        runs = [run for run in report["runs"] if run["case"] == case and 0 < run["error"] < 1]
        for integrator in dict.fromkeys(run["integrator"] for run in runs):
            points = sorted((r["error"], r["cpu_s"] * 1e6) for r in runs if r["integrator"] == integrator)
            ours = integrator.startswith("softdyn")
            (lines[integrator],) = axes.loglog(
                *zip(*points, strict=True),
                "o-" if ours else ".--",
                lw=2 if ours else 1,
                ms=4,
                color=colours[integrator],
            )
        axes.set(title=case, xlabel="largest relative error of h and delta", ylabel="CPU time, microseconds")
        axes.invert_xaxis()
        axes.grid(alpha=0.3)
    for axes in list(figure.axes)[len(names) :]:
        axes.remove()
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=4, fontsize=8)
    return figure


def main(folder: Path) -> int:
    """Run and report; progress goes to stderr."""
    bench(folder, say=lambda line: print(line, file=sys.stderr))
    print((folder / "bench.txt").read_text(encoding="utf-8"), end="")
    return 0
