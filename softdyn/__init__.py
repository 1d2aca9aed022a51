"""softdyn: from a contact law, declared in four sympy expressions, to a proven, fast simulation.

>>> import softdyn
>>> result = softdyn.simulate(
...     law="rognon_gay", parameters={"R": 1.0, "E": 1.0, "eta": 1.0}, h=100.0, force=1e-2, until_h=1e-3
... )
>>> result.h[-1]
np.float64(0.001)

Laws are declared with :mod:`softdyn.derive`; :mod:`softdyn.particles` is for many particles. Importing softdyn imports
nothing heavy: each name is loaded on first use.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

# sympy remembers 1000 results of each of its functions unless told before it is imported: too few for a law's regimes
os.environ.setdefault("SYMPY_CACHE_SIZE", "20000")

from softdyn import particles
from softdyn.errors import CompileError, IntegrationError, LawError, SceneError, SoftdynError

if TYPE_CHECKING:
    from softdyn.api import check, films, fit, load_result, read_scene, regimes, scene_of, simulate, write_report
    from softdyn.fitting.fit_result import Fit
    from softdyn.pair.batch import Batch
    from softdyn.results.pair_result import PairResult
    from softdyn.scene.pair_scene import Scene
    from softdyn.scene.time_tables import Table

__version__ = "0.1.0"
__all__ = [
    "Batch",
    "CompileError",
    "Fit",
    "IntegrationError",
    "LawError",
    "PairResult",
    "Scene",
    "SceneError",
    "SoftdynError",
    "Table",
    "check",
    "films",
    "fit",
    "load_result",
    "particles",
    "read_scene",
    "regimes",
    "scene_of",
    "simulate",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from softdyn import api

        return getattr(api, name)
    raise AttributeError(f"module 'softdyn' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
