"""``softdyn fit``: its options, and what carries it out."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError

#: Adds a command: its name, what carries it out, a line of help, and more of it.
Add = Callable[..., argparse.ArgumentParser]

HELP = """

DATA are tables with headings, separated by commas, semicolons, tabs or spaces: of a pair t and any of h, X, delta, a
and F; of a flow curve rate and stress; each may have its standard error, as F_error. With units in the headings, as
t [s] and F [nN], numbers become those of SI units; values here may have units, too. Several tables are fitted at once,
with h and delta of each its own. What drives the pair is a number, an expression of t, or a column of the data: a
position or a base counts from its first row, where the pair is at the gap h, not deflected; -Z is a column that grows
on approach.

It prints values, standard errors, intervals of 95 % by profiles, and what the data do not determine.

examples:
  softdyn fit steric approach.csv --free Pi0,L,h --set R=10um,E=100kPa,nu=0.5 --set 'eta=1 mPa s' \\
                    --set Pi0=50kPa,L=10nm,h=0.3um --drive spring.stiffness=0.05N/m --drive spring.base=Z -o fit.json
  softdyn fit dlvo surfaces.csv --free ell,Pi0,shift --drive static \\
                    --set R=1cm,E=70GPa,nu=0.2,ell=8nm,Pi0=5kPa,A=1e-20J                    forces at gaps, at rest
  softdyn fit scene.toml drainage.csv --free eta -o fit.npz      law, parameters, h and drive are those of the scene
  softdyn fit herschel-bulkley curve.csv
"""


def add_fit(add: Add) -> None:
    """Add the command to the command line."""
    parser = add("fit", fit_command, "fit a law to curves that were measured, with errors", HELP)
    parser.add_argument(
        "law",
        metavar="LAW",
        help="a law of contacts (a stock one, path/law.py, or path/law.py:name), a scene of two particles (.toml), or "
        "herschel-bulkley or power-law, of flow curves",
    )
    parser.add_argument("data", metavar="DATA", nargs="+", type=Path, help="tables of what was measured")
    parser.add_argument(
        "--free", metavar="NAME,...", action="append", default=[],
        help="what is fitted: parameters of the law, h, delta, stiffness, force, velocity, position, constants; of "
        "forces at rest, shift, which is added to the gaps",
    )  # fmt: skip
    parser.add_argument(
        "--set", metavar="NAME=VALUE,...", dest="numbers", action="append", default=[],
        help="parameters of the law, constants of the drive, h, delta; where the fit starts, if they are free",
    )  # fmt: skip
    parser.add_argument(
        "--drive", metavar="NAME=VALUE", action="append", default=[],
        help="force, velocity, position, or spring.stiffness and spring.base; and speed, of a column that drives, "
        "where there is no column t; or static: nothing moves, and DATA are forces F at gaps h",
    )  # fmt: skip
    parser.add_argument(
        "--loss", choices=("linear", "soft_l1", "huber", "cauchy"), default="linear",
        help="all but linear give less weight to points far off; default: %(default)s",
    )  # fmt: skip
    parser.add_argument(
        "--no-profiles", dest="profiles", action="store_false", help="intervals by standard errors alone: faster"
    )
    parser.add_argument("-o", dest="output", metavar="FILE", type=Path, help="save the fit: .json, .npz, or .csv")
    parser.add_argument(
        "--plot", metavar="PICTURE", type=Path, help=".png, .svg or .pdf; default: FILE with .png, if there is FILE"
    )


def fit_command(options: argparse.Namespace) -> int:
    """Fit, print, save and draw."""
    from softdyn.fitting.fit import FLOW_LAWS, fit
    from softdyn.fitting.fit_result import SUFFIXES

    picture: Path | None = options.plot or (options.output.with_suffix(".png") if options.output else None)
    if options.output is not None and options.output.suffix not in SUFFIXES:
        raise SceneError(f"cannot save to {options.output}: of a fit the ending must be one of {', '.join(SUFFIXES)}")
    if picture is not None and picture.suffix not in (".png", ".svg", ".pdf"):
        raise SceneError(f"cannot draw to {picture}: the ending must be one of .png, .svg, .pdf")
    told: dict[str, Any] = {}
    if options.law.lower() not in FLOW_LAWS:
        told = {"free": [name.strip() for text in options.free for name in text.split(",") if name.strip()] or None}
    elif options.free or options.numbers or options.drive:
        raise SceneError(f"{options.law}: all parameters of a law of flow are fitted, and nothing else is given")
    law: Any = options.law
    if law.endswith(".toml"):
        law = _scene(Path(law))
    if told:
        told |= _numbers(law, options.numbers) | {"drive": _drive(options.drive)}
    found = fit(law, options.data, loss=options.loss, profiles=options.profiles, **told)
    print(found)
    if options.output is not None:
        print(f"wrote {found.save(options.output)}")
    if picture is not None:
        from softdyn.rheology.rheology_plots import save_figure

        save_figure(found.plot(), picture)
        print(f"wrote {picture}")
    return 0


def _scene(path: Path) -> Any:
    from softdyn.scene.pair_scene import read_scene

    return read_scene(path)


def _pairs(option: str, texts: list[str]) -> dict[str, str]:
    """NAME=VALUE, as often as it is said."""
    found: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise SceneError(f"{option} takes NAME=VALUE, not {text!r}")
        found[name.strip()] = value.strip()
    return found


def _numbers(law: Any, texts: list[str]) -> dict[str, Any]:
    """Parameters, constants and the start, apart."""
    from softdyn.derive.law import parameters_of
    from softdyn.laws import law_of
    from softdyn.scene.pair_scene import Scene

    scene = law if isinstance(law, Scene) else None
    names = {symbol.name for symbol in parameters_of(law_of(scene.law if scene is not None else law))}
    given = _pairs("--set", [part for text in texts for part in text.split(",")])
    parameters: dict[str, Any] = dict(scene.parameters) if scene is not None else {}
    constants: dict[str, Any] = dict(scene.constants) if scene is not None else {}
    parameters |= {name: value for name, value in given.items() if name in names}
    start = {name: value for name, value in given.items() if name in ("h", "delta") and name not in names}
    constants |= {name: value for name, value in given.items() if name not in names and name not in start}
    return {"parameters": parameters, "constants": constants, **start}


def _drive(texts: list[str]) -> dict[str, Any] | str | None:
    """The drive as a scene has it."""
    found: dict[str, Any] = {}
    if texts == ["static"]:
        return "static"
    for name, value in _pairs("--drive", texts).items():
        whole, _, part = name.partition(".")
        if whole == "spring" and part in ("stiffness", "base"):
            found.setdefault("spring", {})[part] = value
        else:
            found[name] = value
    if "spring" in found and set(found["spring"]) != {"stiffness", "base"}:
        raise SceneError("--drive: a spring has spring.stiffness=VALUE and spring.base=COLUMN")
    return found or None
