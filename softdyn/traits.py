"""What a run must know of a law besides its kernel, kept on disk: a scene that ran before runs without sympy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softdyn.kernels import manifest_of
from softdyn.laws import LawReference, find, load

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw


@dataclass(frozen=True)
class Traits:
    """What a law's contacts are.

    Attributes
    ----------
    kind : "film", "dry" or "rigid"
        A film between soft particles; no film, zeta = 0; a film between rigid ones, F_ela = oo.
    remote, dashpot : bool
        Whether the law declares a remote force, a dashpot.
    anchored : bool
        Whether the elastic force vanishes at delta = 0.
    rubs : bool
        Whether the law declares what rubs.
    """

    kind: str
    remote: bool
    dashpot: bool
    anchored: bool
    rubs: bool


def traits_of(law: ContactLaw | str | Path) -> Traits:
    """Return what the contacts of a law are.

    Raises
    ------
    LawError, SceneError
        If there is no such law, or if it is faulty.
    """
    reference = find(law)
    if reference.law is not None:
        return Traits(**_traits(reference.law))
    return Traits(**manifest_of(reference, "", {}, "traits", _manifest)["traits"])


def _manifest(reference: LawReference, target: str, needs: Mapping[str, Any]) -> dict[str, Any]:
    law, depends = load(reference)
    return {"traits": _traits(law), "depends": depends}


def _traits(law: ContactLaw) -> dict[str, Any]:
    from softdyn.derive.law import is_anchored, is_dry, is_rigid

    return {
        "kind": "rigid" if is_rigid(law) else "dry" if is_dry(law) else "film",
        "remote": bool(law.F_adh != 0),
        "dashpot": bool(law.dashpot != 0),
        "anchored": is_anchored(law),
        "rubs": law.rubbing is not None,
    }
