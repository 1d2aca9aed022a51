"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from softdyn.errors import SceneError


def beside(path: Path) -> Path:
    """Name of a hidden file, or folder, that nobody else has, beside another, with its ending."""
    return path.with_name(f".{path.stem[:100]}.{secrets.token_hex(8)}{path.suffix}")


class written_whole:
    """Context: a temporary file, of the same ending, that takes the place of ``path`` once it is written."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> Path:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.path.is_dir():
                raise IsADirectoryError(21, "it is a folder")
            self.temporary = beside(self.path)
            # the system takes the umask off; to ask for it is to change it, for all threads
            os.close(os.open(self.temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        except ValueError as error:  # NUL in it
            raise SceneError(f"cannot write {str(self.path)!r}: {error}") from None
        except OSError as error:
            raise SceneError(f"cannot write {self.path}: {error.strerror}") from None
        return self.temporary

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        try:
            if kind is None:
                os.replace(self.temporary, self.path)
        except OSError as failed:
            error = failed
        finally:
            self.temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise SceneError(f"cannot write {self.path}: {error.strerror}") from None


@contextmanager
def folder_whole(final: Path) -> Iterator[tuple[Path, Path]]:
    """Folder to write to, and the one that its files are put into once all are there; nothing is left of a failure."""
    if final.exists() and not final.is_dir():
        raise SceneError(f"cannot write the folder {final}: it is a file")
    folder = beside(final)
    folder.mkdir()
    try:
        yield folder, final
        if not final.exists():
            folder.rename(final)
        else:
            for file in folder.iterdir():
                file.replace(final / file.name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def require_folder(folder: Path) -> None:
    """Make a folder, and see that it takes files, before any work is done.

    Raises
    ------
    SceneError
        If it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise SceneError(f"cannot write to the folder {folder}: {error.strerror}") from None
