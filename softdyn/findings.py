"""What is found of a law, kept on disk: the verdicts on its limits, its regimes, its films.

Input: a law. Output: what the derivation stage finds, from the cache where the same tool has found it before. Reading
can run code, as loading a kernel does: nothing is read where others can write. Where there is no such folder, nothing
is kept.
"""

from __future__ import annotations

import gc
import pickle
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sympy import S, srepr

from softdyn import cache
from softdyn.derivations import UNREADABLE
from softdyn.derive.checks import chains
from softdyn.derive.films import Films, find_films
from softdyn.derive.law import law_hash
from softdyn.derive.limits import Findings, check_limits
from softdyn.derive.regimes import Diagram, discover
from softdyn.errors import SceneError
from softdyn.kernels import tool_digest

if TYPE_CHECKING:
    from softdyn.derive.law import ContactLaw

KIND = "findings"


def limits_of(law: ContactLaw) -> Findings:
    """Return the verdicts on all that a law claims: see :func:`softdyn.derive.limits.check_limits`."""
    found: Findings = _kept("limits", law, lambda: check_limits(law))
    return found


def regimes_of(law: ContactLaw) -> Diagram:
    """Return the regimes of a law: see :func:`softdyn.derive.regimes.discover`."""
    # the law itself is what the caller has: only what was found of it is kept
    found: Diagram = _kept("regimes", law, lambda: replace(discover(law), law=None))  # type: ignore[arg-type]
    return replace(found, law=law)


def films_of(diagram: Diagram) -> Films | None:
    """Return the films of a law, from its regimes: see :func:`softdyn.derive.films.find_films`."""
    found: Films | None = _kept("films", diagram.law, lambda: find_films(diagram))
    return found


def _kept(what: str, law: ContactLaw, find: Callable[[], Any]) -> Any:
    """What was found before by the same tool of the same law, or is found now, and then kept."""
    key = cache.key_of(what, identity(law), tool_digest(), sys.version_info[:3])
    with suppress(SceneError, OSError, *UNREADABLE):
        entry = cache.read(KIND, key)
        if entry is not None:
            return pickle.loads((entry / "found.pickle").read_bytes())
    with _few_collections():
        found = find()
    with suppress(SceneError, OSError, RecursionError):
        cache.publish(KIND, key, {"found.pickle": pickle.dumps(found)})
    return found


@contextmanager
def _few_collections() -> Iterator[None]:
    """Look for cycles of objects less often: a derivation makes millions of small ones, and few cycles of them.

    To look for these takes a tenth of it. Runs keep to what is usual: theirs may hold large arrays.
    """
    usual = gc.get_threshold()
    gc.set_threshold(100_000, 20, 50)
    try:
        yield
    finally:
        gc.set_threshold(*usual)


def identity(law: ContactLaw) -> list[Any]:
    """Return all of a law that anything found of it depends on, as text."""
    claims = [
        [limit.name, [[srepr(S(x)) for x in chain] for chain in chains(limit)]]
        + [[name, srepr(S(form))] for name, form in limit.claims.items()]
        for limit in law.limits
    ]
    return [law_hash(law), [[srepr(symbol), srepr(S(value))] for symbol, value in law.typical.items()], claims]
