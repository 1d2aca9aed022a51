"""States of runs, in files that are there whole or not at all, and hold exactly what was written."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import softdyn
from softdyn.archive import read_arrays, read_json
from softdyn.errors import SceneError
from softdyn.results.frame_file import ENDING
from softdyn.results.result import Result
from softdyn.results.whole_files import written_whole

#: Version of these files; no other is read.
FORMAT = 1


def frames_beside(path: Path) -> Path:
    """The file of the frames of a run, beside its checkpoint."""
    return path.with_name(path.name.removesuffix(".npz").removesuffix(".checkpoint") + ENDING)


def remove(path: Path) -> None:
    """Remove a checkpoint, and the frames beside it."""
    path.unlink(missing_ok=True)
    frames_beside(path).unlink(missing_ok=True)


def plain(value: Any) -> Any:
    """A value of a scene as numbers and words, with every number of a table."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, Mapping):
        return {name: plain(one) for name, one in value.items()}
    return {field.name: plain(getattr(value, field.name)) for field in fields(value)} if is_dataclass(value) else value


def _digest(content: Mapping[str, NDArray[Any]]) -> str:
    """Digest of all arrays: a run goes on from exactly what was written."""
    total = sha256()
    for name, array in sorted(content.items()):
        total.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        total.update(str(array).encode() if array.dtype.kind == "U" else np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def write_state(path: Path, key: str, about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a checkpoint.

    Parameters
    ----------
    path : Path
    key : str
        Digest of what the run depends on.
    about, arrays : mapping
        The state: what JSON holds, and arrays.

    Raises
    ------
    SceneError
        If it cannot be written; then the one before it is still there.
    """
    head = {"kind": "checkpoint", "format": FORMAT, "softdyn": softdyn.__version__, "key": key}
    content: dict[str, Any] = {"about": np.array(json.dumps({**head, **about})), **arrays}
    content["digest"] = np.array(_digest(content))
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **content)


def read_state(path: Path, key: str) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Read a checkpoint.

    Raises
    ------
    SceneError
        If it belongs to another scene, or to another version of softdyn.
    OSError, ValueError, LookupError, TypeError
        If the file is none.
    """
    arrays: dict[str, NDArray[Any]] = read_arrays(path)
    digest = str(arrays.pop("digest")) if "digest" in arrays else None
    about = read_json(str(arrays["about"]))
    if about["kind"] != "checkpoint":
        raise ValueError("it is another kind of file")
    if about.get("format") != FORMAT:
        raise SceneError(
            f"the checkpoint {path} is of another version of softdyn, {about.get('softdyn', 'an earlier one')}: "
            "remove it, or run without --resume"
        )
    if about["key"] != key:
        raise SceneError(
            f"the checkpoint {path} belongs to another scene, or to another version of it: remove it, or run "
            "without --resume"
        )
    if digest != _digest(arrays):
        raise ValueError("it is damaged: its content is not what was written")
    return about, arrays


@contextmanager
def reading_checkpoint(path: Path) -> Iterator[None]:
    """What goes wrong while a checkpoint is read, told as a fault of the file.

    Raises
    ------
    SceneError
    """
    try:
        yield
    except OSError as error:
        raise SceneError(f"cannot read the checkpoint {path}: {error.strerror or error}") from None
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise SceneError(f"{path} is no checkpoint of softdyn: {error}") from None


def save_result(result: Result, path: Path, checkpoint: Path | None) -> None:
    """Save a result; where that fails, the checkpoint stays, and is named.

    Parameters
    ----------
    result : Result
    path : Path
    checkpoint : Path, optional
        Of the run.

    Raises
    ------
    SceneError
    """
    try:
        result.save(path)
    except SceneError as error:
        if checkpoint is None or not checkpoint.exists():
            raise
        raise SceneError(
            f"{error}; a state of the run is in {checkpoint}: the same command with --resume goes on from it"
        ) from None
