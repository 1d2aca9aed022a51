"""What ``generated/`` holds: the kernels and reports of the stock laws, regenerated to the byte."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

from softdyn.errors import SceneError
from softdyn.laws import law_of, package_folder, stock_laws
from softdyn.results import written_whole

if TYPE_CHECKING:
    from softdyn.derive.contact_kernel import ContactNeeds
    from softdyn.derive.law import ContactLaw
    from softdyn.derive.specialise import Needs

GENERATED = package_folder("generated")


def kinds() -> dict[str, Needs]:
    """Kinds of scene that kernels are shown for: one approach, and whatever may come."""
    from softdyn.derive.specialise import Needs

    return {
        "approach": Needs(drive="constant", deflection="compression", outputs=("a", "X", "dh_dt")),
        "general": Needs(drive="table", deflection="either", outputs=None),
    }


def contact_needs(law: ContactLaw) -> ContactNeeds:
    """What kernels of many contacts are shown for."""
    from softdyn.derive.contact_kernel import ContactNeeds

    slides = law.tangential is not None
    return ContactNeeds(varying=("R", "size_ratio"), fading=True, tangential=slides, drag=True)


def generated_files() -> dict[str, str]:
    """Path below ``generated/`` and text of every file that the tool writes there.

    For each stock law: its derivation, the verdicts on its limits, its regimes, and kernels for three kinds of scene on
    both targets: ``approach`` (constant compressive force), ``general`` (any force, as a table; every output), and
    ``contacts`` (many particles of different radii in a fluid, whose contacts have a range).
    """
    from softdyn.derive.contact_kernel import contact_ir
    from softdyn.derive.emit import emit, suffix
    from softdyn.derive.films import find_films
    from softdyn.derive.kernel import kernel_ir
    from softdyn.derive.law import is_dry, is_rigid
    from softdyn.derive.limits import check_limits
    from softdyn.derive.regimes import discover
    from softdyn.derive.typeset import as_text
    from softdyn.study.presence import presence_of
    from softdyn.study.tables import limits_text, regimes_text
    from softdyn.targets import TARGETS

    files = {}
    for name in stock_laws():
        law = law_of(name)
        files[f"{name}/derivation.txt"] = as_text(law)
        files[f"{name}/limits.txt"] = limits_text(law.name, check_limits(law))
        diagram = discover(law)
        files[f"{name}/regimes.txt"] = regimes_text(diagram, find_films(diagram), presence_of(diagram))
        for kind, needs in kinds().items():
            ir = kernel_ir(law, needs)
            for target in TARGETS:
                files[f"{name}/{kind}{suffix(target)}"] = emit(ir, target)
        if not is_rigid(law) and not is_dry(law):
            contacts = contact_ir(law, contact_needs(law))
            for target in TARGETS:
                files[f"{name}/contacts{suffix(target)}"] = emit(contacts, target)
    return files


def write_stock() -> list[str]:
    """Rewrite the files of ``generated/`` that changed; returns their names."""
    changed = []
    for name, text in generated_files().items():
        path = GENERATED / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            with written_whole(path) as temporary:
                temporary.write_text(text, encoding="utf-8")
            changed.append(name)
    return changed


def stock_differences() -> str:
    """Unified diff between what is in ``generated/`` and what would be written; empty if nothing would change."""
    found: list[str] = []
    for name, text in generated_files().items():
        path = GENERATED / name
        try:
            old = path.read_text(encoding="utf-8") if path.is_file() else ""
        except OSError as error:
            raise SceneError(f"cannot read {path}: {error.strerror}") from None
        found += difflib.unified_diff(
            old.splitlines(keepends=True), text.splitlines(keepends=True), f"generated/{name}", f"regenerated/{name}"
        )
    return "".join(found)
