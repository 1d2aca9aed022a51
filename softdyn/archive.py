"""Reading files of arrays (.npz) and JSON that may come from anywhere.

``numpy.load`` believes what such a file says of itself. Here its claims are checked before anything is made of them:
an array is as long as the file has bytes of it, nothing is unpickled, and nothing is unpacked beyond all measure.
"""

from __future__ import annotations

import json
import math
import struct
import sys
import tokenize
import warnings
import zlib
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

#: Bytes that a file may unpack to at least, and how many times its own size beyond that: numbers seldom shrink so much.
LARGEST, RATIO = 2**30, 100


def read_json(text: str) -> Any:
    """Content of JSON.

    Raises
    ------
    ValueError
        Where it is none, or nested too deeply.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of an .npz file by name: of numbers, truth values or text.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        If it is no such file, is damaged, encrypted, or compressed in another way than numpy does, holds anything but
        such arrays, or would unpack to far more than its own size.
    """
    with path.open("rb") as file:
        return arrays_in(file, path.stat().st_size)


def arrays_in(file: IO[bytes], size: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of an .npz archive that is open, of so many bytes; raises as :func:`read_arrays`."""
    try:
        with ZipFile(file) as archive, warnings.catch_warnings():
            warnings.simplefilter("error")  # of old or odd headers
            members = archive.infolist()
            total = sum(member.file_size for member in members)
            if total > LARGEST + RATIO * size:
                raise ValueError(f"its {size} bytes would unpack to {total}")
            found = {_name_of(member): _read_member(archive, member) for member in members}
            if len(found) < len(members):
                raise ValueError("it holds two arrays of one name")
            return found
    except (OSError, ValueError):
        raise
    except BadZipFile as error:
        raise ValueError(f"it is no .npz archive, or a damaged one: {error}") from None
    except (zlib.error, struct.error, tokenize.TokenError) as error:
        raise ValueError(f"it is damaged: {error}") from None
    except (EOFError, KeyError, TypeError, OverflowError, SyntaxError, RuntimeError, MemoryError, Warning) as error:
        said = str(error) or type(error).__name__
        raise ValueError(f"an array in it cannot be read: {said}") from None


def _name_of(member: ZipInfo) -> str:
    if member.flag_bits & 0x1:
        raise ValueError("it is encrypted")
    if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise ValueError("it is compressed in another way than numpy's")
    if not member.filename.endswith(".npy"):
        raise ValueError(f"it holds {member.filename!r}, which is no array")
    return member.filename.removesuffix(".npy")


def _read_member(archive: ZipFile, member: ZipInfo) -> NDArray[Any]:
    """One array, whose header must agree with its size."""
    with archive.open(member) as file:
        shape, fortran, dtype = _header(file)
        if dtype.kind not in "biufU" or not dtype.itemsize:
            raise ValueError(f"{member.filename} is no array of numbers or text, but of {dtype}")
        if not all(isinstance(n, int) and n >= 0 for n in shape):
            raise ValueError(f"{member.filename} has no shape")
        bytes_of = math.prod(shape) * dtype.itemsize
        if bytes_of != member.file_size - file.tell():
            raise ValueError(f"{member.filename} is not as long as it says")
        content = file.read(bytes_of)
    if len(content) != bytes_of:
        raise ValueError(f"{member.filename} is cut short")
    flat = np.frombuffer(content, dtype)
    codes = flat.view(np.dtype(np.uint32).newbyteorder(dtype.byteorder)) if dtype.kind == "U" else np.zeros(0)
    if codes.size and codes.max() > sys.maxunicode:
        raise ValueError(f"{member.filename} holds signs that there are not")
    array = flat.reshape(shape, order="F" if fortran else "C")
    return np.array(array, dtype.newbyteorder("="), order="C")


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        raise ValueError(f"it holds an array of the unknown version {version}")
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, fortran, dtype = read(file)
    return shape, fortran, dtype
