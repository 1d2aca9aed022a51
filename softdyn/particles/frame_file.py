"""Frames of a run on disk, in a file that grows: each is there as soon as it is made, whatever becomes of the run.

Behind a first line come records: the length of what follows, its SHA-256, and the arrays as numpy's .npz. The first one
tells what made the run, each further one is a frame. What is left of a record that was being written is passed over.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator, Mapping
from dataclasses import fields
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softdyn.archive import arrays_in, read_json
from softdyn.errors import SceneError
from softdyn.particles.results import Frame

#: Of the file's name.
ENDING = ".frames"
FIRST_LINE = b"softdyn frames 1\n"
HEAD = struct.Struct("<Q32s")
NAMES = tuple(field.name for field in fields(Frame))


class FrameFile:
    """A list of frames that is kept on disk, not in memory.

    Attributes
    ----------
    path : Path
    ends : list of int
        Place in the file at which each record ends: that of what made the run, and of each frame.
    """

    def __init__(self, path: Path, ends: list[int]) -> None:
        self.path, self.ends = path, ends

    def __len__(self) -> int:
        return len(self.ends) - 1

    def __getitem__(self, number: int) -> Frame:
        number = range(len(self))[number]
        return frame_from(_read(self.path, self.ends[number], self.ends[number + 1]))

    def __setitem__(self, number: int, frame: Frame) -> None:
        """Put another one in the place of the last."""
        assert range(len(self))[number] == len(self) - 1
        del self.ends[-1]
        self.append(frame)

    def __iter__(self) -> Iterator[Frame]:
        return (self[number] for number in range(len(self)))

    def append(self, frame: Frame) -> None:
        """Write a frame behind the others.

        Raises
        ------
        SceneError
            If it cannot be written; then the file is as it was.
        """
        self.ends.append(_append(self.path, self.ends[-1], {name: np.asarray(getattr(frame, name)) for name in NAMES}))


def begin(path: Path, about: Mapping[str, Any], beside: Mapping[str, NDArray[Any]]) -> FrameFile:
    """Begin a file of frames in the place of any that is there.

    Parameters
    ----------
    path : Path
    about : mapping
        What made the run, as plain data; see :mod:`softdyn.results.origin`.
    beside : mapping from str to array
        Its arrays.

    Raises
    ------
    SceneError
        If it cannot be written.
    """
    try:
        path.write_bytes(FIRST_LINE)
    except OSError as error:
        raise SceneError(f"cannot write {path}: {error.strerror}") from None
    return FrameFile(path, [_append(path, len(FIRST_LINE), {"about": np.array(json.dumps(about)), **beside})])


def go_on(path: Path, key: str, count: int) -> FrameFile:
    """Go on with the file of a run behind so many frames; those that follow are made again.

    Raises
    ------
    SceneError
        If they are not there, or the file is of a run with another key.
    """
    about, _, frames = read_frames(path)
    if about.get("key") != key or len(frames) < count:
        raise SceneError(
            f"{path} does not hold the {count} frames that the checkpoint beside it tells of: one of them is of "
            "another run; remove both, or run without --resume"
        )
    return FrameFile(path, frames.ends[: count + 1])


def read_frames(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], FrameFile]:
    """Return what made a run, as plain data with the arrays beside it, and the frames that there are.

    Raises
    ------
    SceneError
        If the file cannot be read, or is none.
    """
    ends = _ends(path)
    if not ends:
        raise SceneError(f"{path} tells of no run")
    beside = _read(path, len(FIRST_LINE), ends[0])
    try:
        return read_json(str(beside.pop("about"))), beside, FrameFile(path, ends)
    except (KeyError, ValueError) as error:
        raise SceneError(f"{path} is no file of frames: {error}") from None


def frame_from(arrays: Mapping[str, NDArray[Any]]) -> Frame:
    """Frame from its arrays.

    Raises
    ------
    SceneError
        If one is missing.
    """
    missing = [name for name in NAMES if name not in arrays]
    if missing:
        raise SceneError(f"a frame has no {', '.join(missing)}")
    return Frame(**{name: arrays[name] for name in NAMES if name != "t"}, t=float(arrays["t"]))


def _append(path: Path, at: int, arrays: Mapping[str, NDArray[Any]]) -> int:
    """Write a record at a place, and tell where it ends."""
    content = BytesIO()
    given: dict[str, Any] = dict(arrays)
    np.savez(content, **given)
    payload = content.getbuffer()
    try:
        with path.open("r+b") as file:
            file.truncate(at)
            file.seek(at)
            file.write(HEAD.pack(len(payload), sha256(payload).digest()))
            file.write(payload)
    except OSError as error:
        raise SceneError(f"cannot write {path}: {error.strerror}") from None
    return at + HEAD.size + len(payload)


def _ends(path: Path) -> list[int]:
    """Where the whole records of a file end."""
    try:
        size = os.stat(path).st_size
        ends = []
        with path.open("rb") as file:
            if file.read(len(FIRST_LINE)) != FIRST_LINE:
                raise SceneError(f"{path} is no file of frames of this version of softdyn")
            place = len(FIRST_LINE)
            while len(head := file.read(HEAD.size)) == HEAD.size:
                place += HEAD.size + HEAD.unpack(head)[0]
                if place > size:
                    break
                ends.append(place)
                file.seek(place)
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror}") from None
    return ends


def _read(path: Path, start: int, end: int) -> dict[str, NDArray[Any]]:
    """Arrays of a record."""
    try:
        with path.open("rb") as file:
            file.seek(start)
            _, digest = HEAD.unpack(file.read(HEAD.size))
            payload = file.read(end - start - HEAD.size)
    except OSError as error:
        raise SceneError(f"cannot read {path}: {error.strerror}") from None
    if sha256(payload).digest() != digest:
        raise SceneError(f"{path} is damaged: what it holds from byte {start} on is not what was written")
    try:
        return arrays_in(BytesIO(payload), len(payload))
    except (OSError, ValueError) as error:
        raise SceneError(f"{path} is no file of frames: {error}") from None
