"""What was found of a law or a closure as it was declared, kept on disk: what is not proved, where nothing is wrong.

Input: what is declared, and how its faults are found. Output: these, and words for what is not known. Proofs that signs
are positive take most of the time of a declaration: they stand while the declaration and the sources of the prover do.
What is kept is text: nothing that is read is run. Where there is no folder that is safe, nothing is kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache as memoize
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from typing import Any

from sympy import Basic, preorder_traversal, srepr

from softdyn import cache
from softdyn.errors import SceneError
from softdyn.laws import digest, package_folder

KIND = "verdicts"


def found_of(
    declared: Any, faults_of: Callable[[Any], list[str]], open_of: Callable[[Any], list[str]]
) -> tuple[list[str], list[str]]:
    """Return the faults of what is declared, and what is not known of it: from the cache, or found now, and then kept.

    Faults are not kept: they are found again as long as they are there.

    Parameters
    ----------
    declared : dataclass
        A law or a closure.
    faults_of, open_of : functions of it
        Find the faults, and what is open where there are none, as messages.
    """
    key = cache.key_of(KIND, type(declared).__name__, written(declared), prover_digest())
    with suppress(SceneError, OSError, ValueError, RecursionError):
        entry = cache.read(KIND, key)
        if entry is not None:
            kept = json.loads((entry / "open.json").read_text(encoding="utf-8"))
            if isinstance(kept, list) and all(isinstance(words, str) for words in kept):
                return [], kept
    faults = faults_of(declared)
    if faults:
        return faults, []
    found = open_of(declared)
    with suppress(SceneError, OSError):
        cache.publish(KIND, key, {"open.json": json.dumps(found).encode()}, replace=True)
    return [], found


def written(value: Any) -> str:
    """Return all of what is declared as text, in which what differs is written differently."""
    if isinstance(value, Basic):
        return _of_expression(value)
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{written(key)}: {written(content)}' for key, content in value.items())}}}"
    if isinstance(value, (tuple, list)):
        return f"({', '.join(map(written, value))})"
    if is_dataclass(value):
        parts = ", ".join(f"{item.name}={written(getattr(value, item.name))}" for item in fields(value))
        return f"{type(value).__name__}({parts})"
    return f"{type(value).__name__} {value!r}"


@lru_cache(maxsize=512)
def _of_expression(value: Basic) -> str:
    # a class of the user's own may have the name of one of sympy's
    kinds = {f"{type(node).__module__}.{type(node).__qualname__}" for node in preorder_traversal(value)}
    return f"{srepr(value)} of {sorted(kinds)}"


@memoize
def prover_digest() -> str:
    """Digest of what checks declarations: the modules of the derivation stage, and the versions that matter."""
    total = sha256(f"sympy {version('sympy')} mpmath {version('mpmath')}".encode())
    for path in sorted(package_folder("derive").glob("*.py")):
        total.update(f"\n{path.name} {digest(path)}".encode())
    return total.hexdigest()
