"""Frames of a run on disk, in a file that grows: each is there as soon as it is made, whatever becomes of the run.

Behind a first line come records: the length of what follows, its SHA-256, and the arrays as numpy's .npz. The first one
tells what made the run, each further one is a frame: a dataclass whose fields are arrays, and ``t``, a number. What is
left of a record that was being written is passed over.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from softdyn.archive import arrays_in, read_json
from softdyn.errors import SceneError
from softdyn.results.origin import Origin, origin_in

#: Of the file's name.
ENDING = ".frames"
FIRST_LINE = b"softdyn frames 1\n"
HEAD = struct.Struct("<Q32s")


class FrameLike(Protocol):
    """A dataclass of arrays, at a time."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def t(self) -> float:
        """The time."""


Frame = TypeVar("Frame", bound=FrameLike)
System = TypeVar("System")


class FrameFile(Generic[Frame]):
    """A list of frames that is kept on disk, not in memory.

    Attributes
    ----------
    path : Path
    kind : type
        Of the frames.
    ends : list of int
        Place in the file at which each record ends: that of what made the run, and of each frame.
    """

    def __init__(self, path: Path, kind: type[Frame], ends: list[int]) -> None:
        self.path, self.kind, self.ends = path, kind, ends

    def __len__(self) -> int:
        return len(self.ends) - 1

    def __getitem__(self, number: int) -> Frame:
        number = range(len(self))[number]
        return frame_from(self.kind, _read(self.path, self.ends[number], self.ends[number + 1]))

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
        arrays = {name: np.asarray(getattr(frame, name)) for name in _names(self.kind)}
        self.ends.append(_append(self.path, self.ends[-1], arrays))


def begin(
    path: Path, kind: type[Frame], about: Mapping[str, Any], beside: Mapping[str, NDArray[Any]]
) -> FrameFile[Frame]:
    """Begin a file of frames in the place of any that is there.

    Parameters
    ----------
    path : Path
    kind : type
        Of its frames.
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
    return FrameFile(path, kind, [_append(path, len(FIRST_LINE), {"about": np.array(json.dumps(about)), **beside})])


def go_on(path: Path, kind: type[Frame], key: str, count: int) -> FrameFile[Frame]:
    """Go on with the file of a run behind so many frames; those that follow are made again.

    Parameters
    ----------
    path : Path
    kind : type
        Of the frames.
    key : str
        Of the scene, which the file must belong to.
    count : int
        Frames that stay.

    Raises
    ------
    SceneError
        If they are not there, or the file is of a run with another key.
    """
    about, _, frames = read_frames(path, kind)
    if about.get("key") != key or len(frames) < count:
        raise SceneError(
            f"{path} does not hold the {count} frames that the checkpoint beside it tells of: one of them is of "
            "another run; remove both, or run without --resume"
        )
    return FrameFile(path, kind, frames.ends[: count + 1])


def read_frames(path: Path, kind: type[Frame]) -> tuple[dict[str, Any], dict[str, NDArray[Any]], FrameFile[Frame]]:
    """Return what made a run, as plain data with the arrays beside it, and the frames that there are.

    Raises
    ------
    SceneError
        If the file cannot be read, or is none.
    """
    about, beside, ends = _told(path)
    return about, beside, FrameFile(path, kind, ends)


def unended(path: Path, kind: type[Frame], made: Callable[[Origin], System]) -> tuple[System, FrameFile[Frame], str]:
    """Return what a run was prepared to, the frames that there are, and words that it has not ended.

    Parameters
    ----------
    path : Path
    kind : type
        Of its frames.
    made : function
        Of the origin of the run: what it was prepared to.

    Raises
    ------
    SceneError
        If the file is no such file, holds no frame, or tells of a scene that cannot be made ready.
    LawError, CompileError
    """
    content, beside, frames = read_frames(path, kind)
    if not len(frames):
        raise SceneError(f"{path} holds no frame yet")
    try:
        origin = origin_in(content, beside)
        if origin is None:
            raise ValueError("it does not tell of its scene")
        system = made(origin)
    except (KeyError, ValueError) as error:
        raise SceneError(f"{path} is no file of frames: {error}") from None
    until = f"the run that wrote {path} has not ended: these are its frames up to t={frames[-1].t:.6g}"
    return system, frames, until


def kind_of_run(path: Path) -> str:
    """Kind of the results of the run that wrote a file of frames.

    Raises
    ------
    SceneError
        If the file cannot be read, or is none.
    """
    return str(_told(path)[0].get("kind", "particles"))


def _told(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], list[int]]:
    """What made a run, the arrays beside it, and where the whole records end."""
    ends = _ends(path)
    if not ends:
        raise SceneError(f"{path} tells of no run")
    beside = _read(path, len(FIRST_LINE), ends[0])
    try:
        return dict(read_json(str(beside.pop("about")))), beside, ends
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(f"{path} is no file of frames: {error}") from None


def _names(kind: type[FrameLike]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def frame_from(kind: type[Frame], arrays: Mapping[str, NDArray[Any]]) -> Frame:
    """Frame from its arrays.

    Raises
    ------
    SceneError
        If one is missing.
    """
    names = _names(kind)
    missing = [name for name in names if name not in arrays]
    if missing:
        raise SceneError(f"a frame has no {', '.join(missing)}")
    values: dict[str, Any] = {name: float(arrays[name]) if name == "t" else arrays[name] for name in names}
    return kind(**values)


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
