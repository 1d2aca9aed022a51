"""What takes long to derive, kept on disk: expressions that follow from others.

Input: what is derived, from what, and how. Output: the expressions, from the cache where the same derivation stage has
found them before. They are kept only if they come back as they are, to the order of their terms: kernels are the same
whether or not they were. As with kernels, nothing is read where others can write.
"""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, TypeVar

from sympy import Add, Basic, Dummy, Mul, Pow

from softdyn import cache
from softdyn.errors import SceneError
from softdyn.verdicts import prover_digest, written

KIND = "derivations"
#: What reading an entry may end with that another process, or another version of a library, has written.
UNREADABLE = (pickle.UnpicklingError, AttributeError, ImportError, EOFError, TypeError, ValueError, RecursionError)
Found = TypeVar("Found", Basic, dict[Any, Any])


def kept(what: str, given: Any, find: Callable[[], Found]) -> Found:
    """Return what was derived before by the same tool of the same, or is derived now, and then kept.

    Parameters
    ----------
    what : str
        Name of what is derived.
    given : expressions, in mappings, sequences or dataclasses
        All that it follows from.
    find : function
        Derives it: an expression, or a mapping of such.
    """
    key = cache.key_of(KIND, what, written(given), prover_digest(), sys.version_info[:3])
    with suppress(SceneError, OSError, *UNREADABLE):
        entry = cache.read(KIND, key)
        if entry is not None:
            there: Found = pickle.loads((entry / "found.pickle").read_bytes())
            return there
    found = find()
    with suppress(SceneError, OSError, *UNREADABLE):
        text = _dumped(found)
        if not _has_dummy(found) and pickle.loads(text) == found:
            cache.publish(KIND, key, {"found.pickle": text}, replace=True)
    return found


class _AsWritten(pickle.Pickler):
    """Sums, products and powers come back as they are: made anew, sympy would multiply some of them out."""

    def reducer_override(self, value: Any) -> Any:
        """How a value is made again, where that is not pickle's own way."""
        if isinstance(value, (Add, Mul, Pow)):
            return _made, (type(value), value.args)
        return NotImplemented


def _made(kind: Any, args: tuple[Basic, ...]) -> Basic:
    made: Basic = kind(*args, evaluate=False) if issubclass(kind, Pow) else kind._from_args(args)
    return made


def _dumped(found: Any) -> bytes:
    stream = io.BytesIO()
    _AsWritten(stream).dump(found)
    return stream.getvalue()


def _has_dummy(found: Any) -> bool:
    """Whether there is a symbol that is another in each process."""
    values = found.values() if isinstance(found, Mapping) else [found]
    return any(value.has(Dummy) for value in values)
