"""What fuzz tests share: mutations of text, of bytes and of arrays, all from seeds; and the one property.

Whatever is read or run gives a result that is finite and fits itself, or one error of the family SoftdynError.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

from softdyn.errors import SoftdynError

Random = np.random.Generator

#: What stands in the place of a value.
VALUES = (
    "0", "-1", "1", "2", "1e308", "-1e308", "1e-308", "5e-324", "nan", "inf", "-inf", "true", "false", '""', '"x"',
    '"t"', '"sin(t)"', '"1/t"', '"nan"', "[]", "[[]]", "[0]", "[1.0, 2.0]", "[[0.0], [2.1]]", "{}", "{a = 1}", "1e400",
    "99999999999999999999", "-0.0", "1_000", "0x10", "1979-05-27", "'''a\nb'''", '"\\u0000"', '"../../x"', '"all"',
)  # fmt: skip


def one_of(random: Random, some: Any) -> Any:
    """Any of them."""
    return some[int(random.integers(len(some)))]


class Enough(Exception):
    """A run has taken as many steps as a test allows."""


def survives(act: Callable[[], Any], what: object) -> Any:
    """What comes of it, or None where it is refused; any other end names what was tried."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return act()
    except SoftdynError as refusal:
        said = str(refusal)
    except Enough:
        return None
    except Exception as fault:
        raise AssertionError(f"{type(fault).__name__}: {fault}\nof {what}") from fault
    assert said.strip(), f"an error without words: {what}"
    return None


def mutated_toml(text: str, random: Random) -> str:
    """One to three changes of lines, values or characters."""
    for _ in range(int(random.integers(1, 4))):
        lines = text.split("\n")
        k, kind = int(random.integers(len(lines))), int(random.integers(8))
        if kind == 0:
            del lines[k]
        elif kind == 1:
            lines.insert(k, lines[int(random.integers(len(lines)))])
        elif kind == 2:
            other = int(random.integers(len(lines)))
            lines[k], lines[other] = lines[other], lines[k]
        elif kind == 3 and "=" in lines[k]:
            key, value = lines[k].split("=", 1)
            lines[k] = f"{key[:-2]}{one_of(random, 'abcxyz_')} ={value}"
        elif kind <= 6 and "=" in lines[k]:
            lines[k] = lines[k].split("=", 1)[0] + "= " + one_of(random, VALUES)
        elif lines[k]:
            at = int(random.integers(len(lines[k])))
            lines[k] = lines[k][:at] + one_of(random, "[]{}=\"'#,.-+eE0\n\t\\\x00\xe9") + lines[k][at + 1 :]
        text = "\n".join(lines)
    return text


def mutated_bytes(content: bytes, random: Random) -> bytes:
    """Cut short, with bits turned, with a part left out or twice, or with other bytes in it."""
    kind = int(random.integers(5))
    if kind == 0:
        return content[: int(random.integers(len(content)))]
    some = bytearray(content)
    if kind == 1:
        for at in random.integers(0, len(some), int(random.integers(1, 9))):
            some[at] ^= 1 << int(random.integers(8))
        return bytes(some)
    start, length = int(random.integers(len(some))), int(random.integers(1, 200))
    if kind == 2:
        return bytes(some[:start] + some[start + length :])
    if kind == 3:
        return bytes(some[:start] + some[start : start + length] + some[start:])
    some[start : start + length] = random.bytes(min(length, len(some) - start))
    return bytes(some)


def mutated_arrays(content: bytes, random: Random) -> bytes:
    """An .npz with one to three of its arrays removed, renamed, of another shape, kind or value."""
    with np.load(io.BytesIO(content)) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for _ in range(int(random.integers(1, 4))):
        name = one_of(random, list(arrays))
        array, kind = arrays.pop(name), int(random.integers(9))
        if kind == 0:
            continue
        if kind == 1:
            name += "x"
        elif kind == 2:
            array = array.reshape(-1)[: max(0, array.size - 1)]
        elif kind == 3:
            array = np.stack([array, array])
        elif kind == 4 and array.dtype.kind in "fiub":
            array = array.astype(one_of(random, [np.float32, np.int8, complex, str, bool, ">f8"]))
        elif kind == 5 and array.dtype.kind == "f" and array.size:
            array = array.copy()
            values = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308]
            array.reshape(-1)[int(random.integers(array.size))] = one_of(random, values)
        elif kind == 6 and array.dtype.kind in "iu" and array.size:
            array = array.copy()
            array.reshape(-1)[int(random.integers(array.size))] = one_of(random, [-1, 99, 127])
        elif kind == 7 and array.dtype.kind == "U":
            text = str(array)
            at = int(random.integers(max(len(text), 1)))
            array = np.array(text[:at] + one_of(random, '}{[]":,0x') + text[at + 1 :])
        elif kind == 8:
            array = np.zeros((0, *array.shape[1:]), array.dtype)
        arrays[name] = array
    out = io.BytesIO()
    with np.errstate(all="ignore"):
        np.savez(out, **arrays)
    return out.getvalue()


def rezipped(content: bytes, random: Random) -> bytes:
    """The same members, otherwise packed: compressed, twice, in another order, with others beside them."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in random.permutation(old.namelist()).tolist():
            method = [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
            new.writestr(name, old.read(name), one_of(random, method))
            if random.random() < 0.05:
                new.writestr(name, old.read(name))
        if random.random() < 0.5:
            new.writestr(one_of(random, ["../x.npy", "a/b", "t", "x.npy"]), random.bytes(20))
    return out.getvalue()
