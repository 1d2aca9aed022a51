"""``softdyn stress particles``: random small scenes of all mechanisms against their equations, written down once more.

What a scene came to is said by :mod:`softdyn.stress.particles.verdicts`; the scenes are those of the seeds 0, 1, 2, ...
"""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from softdyn.bench.record import heading, write_record
from softdyn.results.whole_files import require_folder
from softdyn.stress.judge import OUTCOMES, REFUSED, RIGHT, TOLD, WRONG
from softdyn.stress.particles.sampling import random_case
from softdyn.stress.particles.verdicts import TIGHT, UNKNOWN, Verdict, judge_case

SCENES = 300
#: Outcomes; a scene without a reference is not judged.
ALL = (*OUTCOMES, UNKNOWN)
SHOWN = 10


def stress_particles(folder: Path, scenes: int = SCENES, say: Callable[[str], None] = lambda _: None) -> dict[str, Any]:
    """Judge so many scenes, and write particles.json, particles.txt and particles.png into the folder.

    Parameters
    ----------
    folder : Path
        Made, if it is not there.
    scenes : int
    say : function of str
        Is told a line of each scene that is neither right nor refused, and how many are done.

    Raises
    ------
    SceneError
        If the folder cannot be written to, which is seen before anything is run.
    """
    require_folder(folder)
    began = time.process_time()
    verdicts = []
    for seed in range(scenes):
        verdict = judge_case(seed, random_case(seed))
        verdicts.append(verdict)
        if verdict.outcome not in (RIGHT, REFUSED):
            say(f"scene {seed}: {verdict.outcome}: {_line(asdict(verdict))}")
        elif seed % 10 == 9:
            say(f"{seed + 1} scenes of {scenes}")
    report = {
        **heading("softdyn stress particles", {"numpy": np.__version__, "scipy": scipy.__version__}),
        "cpu_s": round(time.process_time() - began),
        "counts": dict(Counter(v.outcome for v in verdicts)),
        "scenes": [_plain(verdict) for verdict in verdicts],
    }
    write_record(folder, "particles", report, report_text(report), draw)
    return report


def _plain(verdict: Verdict) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in asdict(verdict).items()}


def _judged(report: dict[str, Any]) -> list[dict[str, Any]]:
    """Scenes with an error, the worst first."""
    with_error = [scene for scene in report["scenes"] if scene["error"] is not None]
    return sorted(with_error, key=lambda scene: -scene["error"] / scene["allowed"])


def mechanisms(report: dict[str, Any]) -> dict[str, Counter[str]]:
    """How many scenes with each mechanism came out how."""
    found: dict[str, Counter[str]] = {}
    for scene in report["scenes"]:
        for name in scene["kind"].split(", "):
            found.setdefault(name, Counter())[scene["outcome"]] += 1
    return dict(sorted(found.items(), key=lambda item: (-sum(item[1].values()), item[0])))


def report_text(report: dict[str, Any]) -> str:
    """Counts for each mechanism, the worst scenes, and what was refused."""
    counts, judged = report["counts"], _judged(report)
    lines = [
        f"softdyn stress particles, {report['made']}, {report['machine']}, {report['cpu_s']} s of CPU time",
        ", ".join(f"{name} {number}" for name, number in report["versions"].items()),
        f"{len(report['scenes'])} random scenes: " + ", ".join(f"{counts.get(name, 0)} {name}" for name in ALL),
        "error: the largest difference from the equations integrated by scipy, over all frames and all of positions,",
        "ln h, forces, velocities, spins, stress and box, relative to a radius, to 1, or to the largest of its kind;",
        "allowed: 10 rtol times (1 + the largest response of the equations to a small error of one step);",
        f"each scene is run at a tolerance from 1e-3 to {TIGHT:g}, and at {TIGHT:g}: what is shown is the worse",
        "",
        f"{'mechanism':24}" + "".join(f"{name:>14}" for name in ALL),
    ]
    for name, row in mechanisms(report).items():
        lines.append(f"{name:24}" + "".join(f"{row.get(outcome) or '':>14}" for outcome in ALL).rstrip())
    if judged:
        x = np.array([scene["error"] / scene["rtol"] for scene in judged])
        low, middle, high = np.quantile(x, [0.1, 0.5, 0.9])
        lines += [
            "",
            f"error over rtol: {low:.2g} in a tenth of the scenes, {middle:.2g} in half, {high:.2g} in nine tenths",
        ]
    lines += ["", "the worst, relative to what is allowed"]
    lines += [f"  {scene['seed']:4} {scene['outcome']:6} {_line(scene)}" for scene in judged[:SHOWN]]
    for outcome in (WRONG, TOLD, REFUSED, UNKNOWN):
        rest = [s for s in report["scenes"] if s["outcome"] == outcome and (outcome != WRONG or s["error"] is None)]
        lines += ["", outcome] if rest else []
        lines += [f"  {s['seed']:4} {s['kind']}: {' '.join(s['said'].split())[:200]}" for s in rest]
    return "\n".join(lines) + "\n"


def _line(scene: dict[str, Any]) -> str:
    error = scene["error"]
    size = (
        "" if error is None or not math.isfinite(error) else f"{scene['what']} {error:.1e} of {scene['allowed']:.1e}, "
    )
    return f"{size}rtol {scene['rtol']:g}, {scene['steps']} steps: {scene['kind']}"


COLOURS = {RIGHT: "#2f8f4e", TOLD: "#f0c75e", REFUSED: "#b9bfc7", WRONG: "#c8322b", UNKNOWN: "#7a86c8"}


def draw(report: dict[str, Any]) -> Any:
    """Errors against what is allowed; and how the scenes of each mechanism came out."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 6), layout="constrained")
    left, right = figure.subplots(1, 2)
    judged = _judged(report)
    for outcome in (RIGHT, TOLD, WRONG):
        some = [scene for scene in judged if scene["outcome"] == outcome]
        x, y = [s["allowed"] for s in some], [max(s["error"], 1e-12) for s in some]
        left.loglog(x, y, ".", color=COLOURS[outcome], label=outcome)
    ends = np.array(left.get_xlim())
    left.loglog(ends, ends, color="black", lw=0.8)
    left.set(xlim=ends, xlabel="allowed", ylabel="error", title="difference from the equations, integrated by scipy")
    rows = mechanisms(report)
    start = np.zeros(len(rows))
    for outcome in ALL:
        width = np.array([row.get(outcome, 0) for row in rows.values()], dtype=float)
        right.barh(list(rows), width, left=start, color=COLOURS[outcome], label=outcome)
        start += width
    right.invert_yaxis()
    right.tick_params(labelsize=7)
    right.set(xlabel="scenes")
    right.legend()
    return figure


def main(folder: Path, scenes: int = SCENES) -> int:
    """Run and report, progress to stderr; 1 if anything is wrong."""
    report = stress_particles(folder, scenes, say=lambda line: print(line, file=sys.stderr))
    print((folder / "particles.txt").read_text(encoding="utf-8"), end="")
    return 1 if report["counts"].get(WRONG) else 0
