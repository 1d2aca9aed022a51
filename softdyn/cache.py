"""The kernel cache: a folder of the user's own, safe when processes race.

Every entry is a folder named by its key, holding files and ``entry.json`` with their digests. It is written under
another name and renamed, so that it is there whole or not at all; whatever does not match its digests is a miss.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError

VARIABLE = "SOFTDYN_CACHE_DIR"


def folder() -> Path:
    """Return the cache's folder, made with access for its owner only.

    Raises
    ------
    SceneError
        If it cannot be made or belongs to somebody else.
    """
    if os.environ.get(VARIABLE):
        path = Path(os.environ[VARIABLE]).expanduser().absolute()
    else:
        import platformdirs

        path = Path(platformdirs.user_cache_path("softdyn", appauthor=False))
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        owner = path.stat().st_uid
    except OSError as error:
        raise SceneError(
            f"cannot make the kernel cache {path}: {error.strerror}; set {VARIABLE} to another folder"
        ) from None
    if hasattr(os, "getuid") and owner != os.getuid():
        raise SceneError(f"the kernel cache {path} belongs to another user; set {VARIABLE} to a folder of your own")
    return path


def key_of(*parts: Any) -> str:
    """Key of an entry: a digest of everything that it depends on."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return sha256(text.encode()).hexdigest()[:32]


def read(kind: str, key: str) -> Path | None:
    """Folder of an entry, if it is there and whole."""
    path = folder() / kind / key
    try:
        digests: Mapping[str, str] = json.loads((path / "entry.json").read_text(encoding="utf-8"))["digests"]
        for name, expected in digests.items():
            if sha256((path / name).read_bytes()).hexdigest() != expected:
                return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return path


def publish(
    kind: str, key: str, files: Mapping[str, bytes], note: Mapping[str, Any] | None = None, replace: bool = False
) -> Path:
    """Store an entry and return its folder.

    Where another process was faster, its entry is kept, unless ``replace`` says that what is there is out of date.

    Raises
    ------
    SceneError
        If it cannot be written.
    """
    parent = folder() / kind
    target = parent / key
    try:
        parent.mkdir(mode=0o700, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=".", dir=parent))
        try:
            for name, content in files.items():
                (made / name).write_bytes(content)
            digests = {name: sha256(content).hexdigest() for name, content in files.items()}
            entry = {"digests": digests, **(note or {})}
            (made / "entry.json").write_text(json.dumps(entry, indent=1), encoding="utf-8")
            try:
                made.rename(target)
            except OSError:
                _put_in_place(kind, key, made, replace)
        finally:
            shutil.rmtree(made, ignore_errors=True)
    except OSError as error:
        raise SceneError(
            f"cannot write the kernel cache {parent}: {error.strerror}; set {VARIABLE} to another folder"
        ) from None
    return target


def _put_in_place(kind: str, key: str, made: Path, replace: bool) -> None:
    """Put a new entry in the place of a damaged one, or of any; else a whole one, of another process's, stays."""
    target = folder() / kind / key
    with _locked(folder() / f"{kind}.lock"):
        if not replace and read(kind, key) is not None:
            return
        aside = Path(tempfile.mkdtemp(prefix=".", dir=target.parent))
        try:
            target.rename(aside / "old")
            made.rename(target)
        except OSError:
            if read(kind, key) is None:  # else it was published in this very moment
                raise
        finally:
            shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Only one process at a time, where the system has advisory locks."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
