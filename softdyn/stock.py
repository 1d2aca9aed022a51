"""What ``generated/`` holds: the kernels and reports of the stock laws, regenerated to the byte."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from softdyn.errors import SceneError
from softdyn.laws import law_of, package_folder, stock_laws
from softdyn.results.whole_files import written_whole

if TYPE_CHECKING:
    from softdyn.derive.contact_equations import ContactNeeds
    from softdyn.derive.kernel_form import KernelIR
    from softdyn.derive.law import ContactLaw
    from softdyn.derive.pair_equations import Needs

#: Beside derive/ in a checkout, and not installed.
GENERATED = package_folder("derive").resolve().parent / "generated"
#: The law whose kernels are there to be read; of the others there are digests.
SHOWN = "rognon_gay"


def kinds() -> dict[str, Needs]:
    """Kinds of scene that kernels are shown for: one approach, and whatever may come."""
    from softdyn.derive.pair_equations import Needs

    return {
        "approach": Needs(drive="constant", deflection="compression", outputs=("a", "X", "dh_dt")),
        "general": Needs(drive="table", deflection="either", outputs=None),
    }


def contact_needs(law: ContactLaw) -> ContactNeeds:
    """What kernels of many contacts are shown for."""
    from softdyn.derive.contact_equations import ContactNeeds

    slides = law.tangential is not None
    return ContactNeeds(varying=("R", "size_ratio"), fading=True, tangential=slides, drag=True)


def generated_files() -> dict[str, str]:
    """Path below ``generated/`` and text of every file that the tool writes there.

    For each stock law: its derivation, the verdicts on its limits, its regimes, and kernels for three kinds of scene on
    all targets: ``approach`` (constant compressive force), ``general`` (any force, as a table; every output), and
    ``contacts`` (many particles of different radii in a fluid, whose contacts have a range). The kernels of one law are
    there to be read; of the others there is ``kernels.txt``, a digest of each.
    """
    from softdyn.derive.contact_kernel import contact_ir
    from softdyn.derive.emit import emit, suffix
    from softdyn.derive.films import find_films
    from softdyn.derive.law import is_dry
    from softdyn.derive.limits import check_limits
    from softdyn.derive.pair_kernel import kernel_ir
    from softdyn.derive.regimes import discover
    from softdyn.derive.typeset import as_text
    from softdyn.study.findings_text import limits_text, regimes_text
    from softdyn.study.presence import presence_of
    from softdyn.targets import TARGETS

    files = {}
    for name in stock_laws():
        law = law_of(name)
        files[f"{name}/derivation.txt"] = as_text(law)
        files[f"{name}/limits.txt"] = limits_text(law.name, check_limits(law))
        diagram = discover(law)
        files[f"{name}/regimes.txt"] = regimes_text(diagram, find_films(diagram), presence_of(diagram))
        of_many = is_dry(law) and (law.dashpot != 0 or law.F_adh != 0)  # a pair of such is a scene of many
        made: dict[str, KernelIR] = {kind: kernel_ir(law, needs) for kind, needs in kinds().items() if not of_many}
        made["contacts"] = contact_ir(law, contact_needs(law))
        kernels = {f"{kind}{suffix(target)}": emit(ir, target) for kind, ir in made.items() for target in TARGETS}
        if name == SHOWN:
            files |= {f"{name}/{file}": text for file, text in kernels.items()}
        else:
            lines = (f"{sha256(text.encode()).hexdigest()}  {file}\n" for file, text in kernels.items())
            files[f"{name}/kernels.txt"] = "".join(lines)
    return files


def _left_over(files: Iterable[str]) -> list[Path]:
    """Files in the folders of laws that the tool would not write."""
    written = {GENERATED / name for name in files}
    folders = sorted({path.parent for path in written})
    return [path for folder in folders if folder.is_dir() for path in sorted(folder.iterdir()) if path not in written]


def _require_checkout() -> None:
    if not GENERATED.is_dir():
        raise SceneError(
            f"generated/ belongs to a checkout of softdyn, and {GENERATED} is none: this is an installation"
        )


def write_stock() -> list[str]:
    """Rewrite the files of ``generated/`` that changed, and remove what is left over; returns what was done to each."""
    _require_checkout()
    changed, files = [], generated_files()
    for path in _left_over(files):
        path.unlink()
        changed.append(f"removed generated/{path.relative_to(GENERATED).as_posix()}")
    for name, text in files.items():
        path = GENERATED / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            with written_whole(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
            changed.append(f"wrote generated/{name}")
    return changed


def stock_differences() -> str:
    """Unified diff between what is in ``generated/`` and what would be written; empty if nothing would change."""
    _require_checkout()
    files = generated_files()
    found = [f"generated/{path.relative_to(GENERATED).as_posix()} would not be written\n" for path in _left_over(files)]
    for name, text in files.items():
        path = GENERATED / name
        try:
            old = path.read_text(encoding="utf-8") if path.is_file() else ""
        except OSError as error:
            raise SceneError(f"cannot read {path}: {error.strerror}") from None
        found += difflib.unified_diff(
            old.splitlines(keepends=True), text.splitlines(keepends=True), f"generated/{name}", f"regenerated/{name}"
        )
    return "".join(found)
