"""``softdyn compress``: quasi-static compression and shear, the jamming point, coordination, and moduli."""

from __future__ import annotations

import argparse

import numpy as np

from softdyn.errors import SceneError
from softdyn.rheology.curves import Curves, gathered_curves
from softdyn.rheology.options import runs_folder
from softdyn.rheology.quasi_static import Protocol, check_protocol, jamming_point, make_protocol, protocol_curve
from softdyn.rheology.runs import planned
from softdyn.rheology.sweep_command import (
    many_runs,
    particle_content,
    require_files,
    tell_failures,
    varied_options,
)
from softdyn.scene.stock_scenes import found_scene
from softdyn.varied import read_named, read_varied


def compress(options: argparse.Namespace) -> int:
    """Carry out the command.

    Raises
    ------
    SceneError
    """
    picture = require_files(options)
    fractions = read_named("--fractions", options.fractions)
    if not (np.isfinite(fractions) & (fractions > 0)).all():
        raise SceneError(f"--fractions {options.fractions}: fractions must be positive")
    strains = read_named("--strains", options.strains) if options.strains is not None else np.zeros(0)
    protocol = Protocol(tuple(fractions.tolist()), tuple(strains.tolist()), options.probe, options.rest)
    check_protocol(protocol)
    content, home = particle_content(found_scene(options.scene))
    # the box rests but for its steps: what the scene says of its flow, end and outputs is left aside
    content = {**content, "until": {"t": options.rest}}
    content["flow"] = {name: value for name, value in content.get("flow", {}).items() if name != "shear_rate"}
    vary = read_varied(options.vary)
    runs = planned(content, home, runs_folder(options.output), vary, None, vars(protocol))
    command = ["softdyn", "compress", str(options.scene), f"--fractions={options.fractions}"]
    command += [f"--strains={options.strains}"] if options.strains is not None else []
    command += [f"--probe={options.probe!r}", "--rest", repr(options.rest), *varied_options(options)]
    command += ["-o", str(options.output), "--plot", str(picture)]

    def finish() -> int:
        curves = gathered_curves(runs, vary, protocol_curve)
        curves.save(options.output)
        tell_failures(runs, curves)
        _tell(curves, len(fractions))
        written = str(options.output)
        if curves.curves:
            from softdyn.rheology.rheology_plots import draw_compressions, save_figure

            save_figure(draw_compressions(curves, len(fractions)), picture, curves.units)
            written += f" and {picture}"
        print(f"wrote {written}; the states are in {runs_folder(options.output)}")
        return 1 if curves.failed or curves.missing else 0

    return many_runs(options, runs, command, finish, work=make_protocol)


def _tell(curves: Curves, compressed: int) -> None:
    """Print the states of each run, and its jamming point."""
    for number, curve in curves.curves.items():
        print(f"{curves.words(number) or 'run 0'}:")
        print("  fraction   strain     pressure   coordination   rattlers   shear modulus   bulk modulus")
        for k in range(len(curve["fraction"])):
            shown = [f"{curve['fraction'][k]:<9.5g}", f"{curve['strain'][k]:<9.4g}", f"{curve['pressure'][k]:<9.4g}"]
            shown += [f"{curve['coordination'][k]:<13.4g}", f"{curve['rattlers'][k]:<9.3g}"]
            shown += [f"{curve['shear_modulus'][k]:<14.4g}", f"{curve['bulk_modulus'][k]:<11.4g}"]
            print("  " + "  ".join([*shown, "" if curve["settled"][k] else "has not settled"]).rstrip())
        rising = int(np.argmax(np.append(np.diff(curve["fraction"][:compressed]) < 0, True))) + 1
        point = jamming_point(curve["fraction"][:rising], curve["pressure"][:rising])
        if np.isnan(point.above):
            print("  no state has a pressure: it does not jam up to the last fraction")
            continue
        where = f"below {point.above:.5g}" if np.isnan(point.below) else f"from {point.below:.5g} to {point.above:.5g}"
        told = f"  pressure sets in {where}"
        if np.isfinite(point.fraction):
            told += (
                f"; it extrapolates to 0 at {point.fraction:.5g} +- {point.error:.1g}, exponent {point.exponent:.3g}"
            )
        print(told)
