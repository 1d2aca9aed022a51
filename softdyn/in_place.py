"""Imports from a folder that holds a checkout of the name ``softdyn``.

There Python takes the checkout itself for a package without a file, and finds nothing in it. An installation in place
(``pip install -e``) carries a copy of this module, which stands by itself, and installs the finder as Python starts: it
answers only where Python would find such a package, and lets what else knows of softdyn find it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType


class InPlaceFinder:
    """Finds softdyn where a folder of that name would hide it."""

    @classmethod
    def find_spec(
        cls, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where a module is, as the import system asks.

        Parameters
        ----------
        name : str
        path : sequence of str, optional
            Of the package that the module is in.
        target : module, optional
            Which is loaded anew.
        """
        if name != "softdyn":
            return None
        usual = PathFinder.find_spec(name, path, target)
        if usual is None or usual.loader is not None:
            return None
        # another copy of this one would ask back
        others = (
            finder
            for finder in sys.meta_path
            if finder is not PathFinder and getattr(finder, "__name__", "") != cls.__name__
        )
        return next((found for finder in others if (found := finder.find_spec(name, path, target))), None)


def install() -> None:
    """Have the finder asked first."""
    if InPlaceFinder not in sys.meta_path:
        sys.meta_path.insert(0, InPlaceFinder)
