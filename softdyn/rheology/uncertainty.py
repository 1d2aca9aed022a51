"""``softdyn uncertainty``: what a scene gives if some of its numbers are known as distributions only.

Runs at quasi-random samples; of each number that is measured, quantiles; and, if asked for, by which parameter it
varies: indices of Sobol. A first-order index is the part of the variance that goes if the parameter becomes known; a
total one is the part that stays if all others become known.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from softdyn.errors import SceneError
from softdyn.results.whole_files import written_whole
from softdyn.rheology.distributions import read_given, samples_of
from softdyn.rheology.options import runs_folder
from softdyn.rheology.run_table import RunTable, gathered, measured_run
from softdyn.rheology.runs import MOST_RUNS, Run, putting
from softdyn.rheology.sweep_command import many_runs, require_files, status_of, tell_notes
from softdyn.scene.reading import read_toml
from softdyn.scene.stock_scenes import found_scene
from softdyn.words import suggestion

Array = NDArray[np.float64]

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: Observables that are drawn and printed unless others are asked for.
SHOWN = 4
#: Of the intervals of indices; resamples that they are of; and their seed, so that a table is made the same again.
CONFIDENCE, RESAMPLES, SEED = 0.95, 999, 1
#: Relative difference that is none.
ROUNDING = 1e-12
#: Endings of columns beside that of a mean; and of those that tell of others, or of how well a run went.
OF_MEANS = ("_min", "_max", "_end")
ABOUT = ("_error", "_imbalance", "_repeats", "_change", "steady", "steady_from")


@dataclass(frozen=True)
class Indices:
    """Indices of Sobol of one observable.

    Attributes
    ----------
    first, total : mapping from str to (value, low, high)
        By parameter, with the bounds of an interval of confidence.
    """

    first: Mapping[str, tuple[float, float, float]]
    total: Mapping[str, tuple[float, float, float]]


def uncertainty(options: argparse.Namespace) -> int:
    """Carry out the command.

    Raises
    ------
    SceneError
    """
    picture = require_files(options)
    file = found_scene(options.scene)
    content, given = read_toml(file), read_given(options.given)
    samples = samples_of(given, options.samples, options.seed, options.sobol)
    if len(samples) > MOST_RUNS:
        raise SceneError(f"{len(samples)} runs: at most {MOST_RUNS} are made, each with a file of its own")
    put = putting(content)
    runs = [
        Run(number, values, put(dict(content), values), file.parent, runs_folder(options.output))
        for number, values in enumerate(samples)
    ]
    command = ["softdyn", "uncertainty", str(options.scene)]
    command += [part for text in options.given for part in ("--given", text)]
    command += ["--samples", str(options.samples), "--seed", str(options.seed), *(["--sobol"] if options.sobol else [])]
    command += [*(["--observe", options.observe] if options.observe else []), "-o", str(options.output)]
    command += ["--plot", str(picture)]

    def finish() -> int:
        table = gathered(runs, {"sample": np.arange(len(runs), dtype=float)}, measured_run)
        table.save(options.output)
        tell_notes(runs, table)
        print(f"wrote {options.output}; the results are in {runs_folder(options.output)}")
        if len(table.failed) + len(table.missing) < len(runs):
            _tell(table, list(given), options, picture)
        return status_of(table)

    return many_runs(options, runs, command, finish)


def _tell(table: RunTable, names: Sequence[str], options: argparse.Namespace, picture: Path) -> None:
    """Write quantiles and indices beside the table, print and draw those that are observed."""
    from softdyn.rheology.rheology_plots import draw_uncertainty, save_figure

    output: Path = options.output
    shown = observed(table, options.observe)
    # of the samples that are made for indices, A and B are drawn as the distributions say
    drawn = options.samples * (2 if options.sobol else 1)
    quantiles = quantiles_of(table, drawn)
    files = [output.with_name(f"{output.stem}.quantiles.csv")]
    _write(files[0], ["observable", "runs", "mean", "deviation", *(f"q{q:g}" for q in QUANTILES)], quantiles.items())
    indices: dict[str, Indices] = {}
    if options.sobol and (table.failed or table.missing):
        lacking = len(table.failed) + len(table.missing)
        print(f"{lacking} runs are lacking, and indices of Sobol need all: choose distributions that none fails with")
    elif options.sobol:
        indices = {name: sobol_indices(table.columns[name], names, options.samples) for name in varying(table)}
        files.append(output.with_name(f"{output.stem}.sobol.csv"))
        heads = [
            "observable",
            "parameter",
            *(f"{kind}{end}" for kind in ("first", "total") for end in ("", "_low", "_high")),
        ]
        rows = [(f"{name},{by}", (*of.first[by], *of.total[by])) for name, of in indices.items() for by in names]
        _write(files[1], heads, rows)
    for name in shown:
        print("\n".join(_in_words(name, quantiles[name], indices.get(name))))
    save_figure(draw_uncertainty(table, drawn, shown, indices), picture)
    print(f"wrote {', '.join(map(str, files))} and {picture}")


def _in_words(name: str, quantiles: Sequence[float], indices: Indices | None) -> list[str]:
    """What is printed of an observable."""
    _, mean, deviation, low, _, middle, _, high = quantiles
    lines = [
        f"{name}: {mean:.4g} +- {deviation:.2g}; 5 % below {low:.4g}, half below {middle:.4g}, 95 % below {high:.4g}"
    ]
    for kind, of in (("first order", indices.first), ("total", indices.total)) if indices else ():
        parts = ", ".join(f"{by} {value:.2f} ({low:.2f} to {high:.2f})" for by, (value, low, high) in of.items())
        lines.append(f"  of its variance, {kind}: {parts}")
    return lines


def _write(path: Path, heads: Sequence[str], rows: Iterable[tuple[str, Sequence[float]]]) -> None:
    """Write a table: a name, then numbers."""
    lines = [",".join(heads), *(",".join([name, *(f"{value:.12g}" for value in values)]) for name, values in rows)]
    with written_whole(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def varying(table: RunTable) -> list[str]:
    """Names of the columns that are observables, and differ between runs by more than rounding."""
    found = []
    for name, values in table.columns.items():
        there = values[np.isfinite(values)]
        if not name.endswith(ABOUT) and len(there) and np.ptp(there) > ROUNDING * np.abs(there).max():
            found.append(name)
    return found


def observed(table: RunTable, asked: str | None) -> list[str]:
    """Names of the columns that are shown: those that are asked for, or the first few that vary.

    Raises
    ------
    SceneError
        If there is none of a name.
    """
    beside = {f"{name}{ending}" for name in table.columns for ending in OF_MEANS}
    own = [name for name in varying(table) if name not in beside]
    names = [part.strip() for part in asked.split(",")] if asked else own[:SHOWN]
    for name in names:
        if name not in table.columns:
            raise SceneError(f"--observe {name}: the table has no such column{suggestion(name, list(table.columns))}")
    return names


def quantiles_of(table: RunTable, drawn: int) -> dict[str, tuple[float, ...]]:
    """Of each column: runs that have it, mean, standard deviation, and its values at ``QUANTILES``.

    Parameters
    ----------
    table : RunTable
    drawn : int
        How many of the runs, from the first on, are samples of the distributions.
    """
    found = {}
    for name, values in table.columns.items():
        there = values[:drawn][np.isfinite(values[:drawn])]
        if len(there):
            at = np.quantile(there, QUANTILES)
            found[name] = (float(len(there)), float(there.mean()), float(there.std()), *map(float, at))
    return found


def sobol_indices(values: Array, names: Sequence[str], count: int) -> Indices:
    """Indices of Sobol of an observable (Saltelli et al. 2010, doi:10.1016/j.cpc.2009.09.018).

    Parameters
    ----------
    values : array, shape (count (parameters + 2),)
        At the samples of :func:`softdyn.rheology.distributions.samples_of`.
    names : sequence of str
        Of the parameters.
    count : int
        A power of two.
    """
    a, b, mixed = values[:count], values[count : 2 * count], values[2 * count :].reshape(len(names), 1, count)
    found = stats.sobol_indices(func={"f_A": a[None], "f_B": b[None], "f_AB": mixed}, n=count)
    rng = np.random.default_rng(SEED)
    index = rng.integers(0, count, (RESAMPLES, count))
    draws = [
        stats.sobol_indices(func={"f_A": a[None, k], "f_B": b[None, k], "f_AB": mixed[..., k]}, n=count) for k in index
    ]
    tails = ((1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2)
    sides = []
    for kind in ("first_order", "total_order"):
        at = np.reshape(getattr(found, kind), len(names))
        low, high = np.quantile([np.reshape(getattr(draw, kind), len(names)) for draw in draws], tails, axis=0)
        sides.append({name: (float(at[k]), float(low[k]), float(high[k])) for k, name in enumerate(names)})
    return Indices(*sides)
