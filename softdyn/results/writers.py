"""Packages that write results in the formats of others."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

from softdyn.errors import SceneError

#: Package that writes files of each ending. gsd is the format's own; of the packages that write VTK's XML, pyevtk is
#: kept up and needs numpy alone.
WRITERS = {".gsd": "gsd.hoomd", ".pvd": "pyevtk.hl", ".csv": "pandas", ".nc": "xarray"}
#: What installs a package.
EXTRAS = {"gsd": "formats", "pyevtk": "formats", "pandas": "data", "xarray": "data"}


def require_writer(path: Path) -> ModuleType:
    """Package that writes files of this ending.

    Raises
    ------
    SceneError
        If it is not installed, or there is none.
    """
    if path.suffix not in WRITERS:
        raise SceneError(f"cannot save to {path}: the ending must be one of .npz, {', '.join(WRITERS)}")
    name = WRITERS[path.suffix]
    try:
        return importlib.import_module(name)
    except ImportError:
        package = name.partition(".")[0]
        raise SceneError(
            f"writing {path} needs the package {package}: pip install 'softdyn[{EXTRAS[package]}]' (.npz needs nothing)"
        ) from None
