"""Building an installation in place: what setuptools makes, and the finder of :mod:`softdyn.in_place` beside it.

``pyproject.toml`` names the command; setuptools imports this module by itself, before there is a package.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from setuptools.command.editable_wheel import editable_wheel

MODULE = "softdyn_in_place"


class EditableWheel(editable_wheel):
    """The wheel of an installation in place, with a module more and a line that has Python import it as it starts."""

    def _run_build_commands(self, dist_name: str, unpacked_wheel: Any, *folders: Any) -> Any:
        made = super()._run_build_commands(dist_name, unpacked_wheel, *folders)
        shutil.copy(Path(__file__).with_name("in_place.py"), Path(unpacked_wheel, f"{MODULE}.py"))
        Path(unpacked_wheel, f"{MODULE}.pth").write_text(f"import {MODULE}; {MODULE}.install()\n", encoding="utf-8")
        return made
