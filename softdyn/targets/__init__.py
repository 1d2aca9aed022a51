"""The targets: one module each, with the same names, and a folder of templates of the same name.

``SUFFIX`` is the ending of its files, ``translate(body)`` writes text in the shared subset of Python in its language.
``identity()`` tells what, besides the source, the built kernel depends on; ``build(name, source, made_by, functions)``
makes the files of a cache entry, and sees that these functions are in it; ``check(folder, name, functions)`` sees that
a kernel of unknown origin loads; ``load(folder, name, functions, later)`` returns its functions. ``available()`` tells
whether this machine can build it. A module beside these is a target more.

Of :data:`PLUGINS` the kernels are part of another program, which is told how to run a scene by a room of that name:
``load`` has nothing to give, and only some kinds of kernels are there.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from types import ModuleType

from softdyn.errors import SceneError

#: What a function returns, "int", "float" or "None", and the types of its arguments: "int", "float", "array",
#: "indices" and "short_indices", arrays of integers of 64 and of 32 bits.
Signature = Sequence[str | Sequence[str]]
Signatures = Mapping[str, Signature]

#: Targets that another program loads.
PLUGINS = ("lammps",)
TARGETS = tuple(sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name not in PLUGINS))
#: What a scene may name: "auto" is C where there is a compiler, else numba.
CHOICES = ("auto", *TARGETS)


class LoadError(SceneError):
    """A built kernel does not load: its entry in the cache is to be made anew."""


def target_module(target: str) -> ModuleType:
    """The module of a target."""
    return importlib.import_module(f"softdyn.targets.{target}")
