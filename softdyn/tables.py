"""Tables of numbers in text files: the one reader of all of them.

A table has a row of numbers a line, separated by commas, semicolons, tabs or spaces; the decimal mark may be a comma
where that does not separate. Lines that start with ``#`` are comments, and so is what follows a ``#``. Headings, in a
line of their own or in the last comment before the numbers, say which column is which, in any order; a unit after a
heading, as in ``time (s)``, is a note for the reader.
"""

from __future__ import annotations

import csv
import re
import zipfile
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from softdyn.errors import SceneError
from softdyn.words import listed, suggestion

Array = NDArray[np.float64]

#: Rows that a table may have.
MOST_ROWS = 10_000_000
#: Lines of numbers by which the separator and the decimal mark are told.
LOOKED_AT = 20
#: Lines that are read at once.
BLOCK = 100_000
#: Bytes by which a file of another format is told.
HEAD = 4096

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?")
_WHOLE = re.compile(r"[+-]?\d+")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_UNIT = re.compile(r"\s*(\([^()]*\)|\[[^\[\]]*\]|/\s*\S+)\s*$")
_BRACKETS = re.compile(r"\s*(?:\([^()]*\)|\[[^\[\]]*\])")
_WORD = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True)
class Column:
    """A column that a table may have.

    Parameters
    ----------
    name : str
        What it is called in what is read, and its first heading.
    also : tuple of str
        Other headings of it. Headings of one letter are taken to the letter, others in any case.
    needed : bool
    words : bool
        Its cells are names, not numbers.
    """

    name: str
    also: tuple[str, ...] = ()
    needed: bool = True
    words: bool = False


@dataclass(frozen=True)
class Columns:
    """Columns of a table: under each name an array of numbers, or of names, shape (rows,).

    ``units`` are what stands behind the headings, "nN" of "F [nN]"; numbers are as they are written.
    """

    path: Path
    kind: str
    values: Mapping[str, NDArray[Any]]
    shape: Shape
    units: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.values[name]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def __len__(self) -> int:
        return len(next(iter(self.values.values())))

    def at(self, row: int) -> str:
        """Where a row is, for a message: the table and the line."""
        number = next((number for number, _ in islice(_rows(self.path, self.shape), row, None)), 0)
        return f"{self.kind} {self.path}, line {number}"


@dataclass(frozen=True)
class Shape:
    """How a table is written.

    Attributes
    ----------
    encoding : str
    separator : str or None
        None for spaces.
    marks : mapping from str to str
        Decimal marks that were seen, each with a number that has it.
    first : int
        The line of the first numbers.
    headings : list of str or None
    width : int
        How many columns there are; 0 without any line of numbers.
    """

    encoding: str
    separator: str | None
    marks: Mapping[str, str]
    first: int
    headings: list[str] | None
    width: int


def read_columns(
    path: str | Path,
    kind: str,
    known: Sequence[Column],
    *,
    order: Sequence[str] | None = None,
    besides: Sequence[str] = (),
) -> Columns:
    """Read a table.

    Parameters
    ----------
    path : str or Path
    kind : str
        What it is, for messages: "table", "particles".
    known : sequence of Column
        The columns that it may have.
    order : sequence of str, optional
        Names of the columns of a table without headings; without it, headings are needed.
    besides : sequence of str
        Headings of columns that may be there, and are left out.

    Returns
    -------
    Columns
        Those of ``known`` that are there, all numbers finite.

    Raises
    ------
    SceneError
        If the file is no such table; naming the format where it is another, the columns that are unknown, missing or
        there twice, or the line at fault.
    """
    path = Path(path)
    try:
        shape = _shape(path, _encoding(path, kind), known)
        names = _names(f"{kind} {path}", shape, known, order, besides)
        words = {column.name for column in known if column.words}
        values = _values(path, kind, shape, names, words)
    except UnicodeError:
        raise SceneError(f"the {kind} {path} is not text in UTF-8: save it as such") from None
    except csv.Error as error:
        raise SceneError(f"the {kind} {path} is no table: {error}") from None
    except OSError as error:
        raise SceneError(f"cannot read the {kind} {path}: {error.strerror}") from None
    told = {name: _unit_of(title) for name, title in zip(names, shape.headings or [], strict=False) if name is not None}
    read = Columns(path, kind, values, shape, {name: unit for name, unit in told.items() if unit})
    if len(read) > MOST_ROWS:
        raise SceneError(f"the {kind} {path} has more than {MOST_ROWS} rows, the most that are read")
    for name, column in values.items():
        if name not in words and not np.isfinite(column).all():
            row = int(np.argmin(np.isfinite(column)))
            raise SceneError(f"{read.at(row)}: {name} = {column[row]:g} is not finite")
    return read


def _encoding(path: Path, kind: str) -> str:
    """Encoding of a text file by its first bytes; refuse what is no table."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise SceneError(f"cannot read the {kind} {path}: {error.strerror}") from None
    except ValueError as error:
        raise SceneError(f"cannot read the {kind} {str(path)!r}: {error}") from None
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    other = _other_format(head, path)
    if other:
        raise SceneError(f"the {kind} {path} is {other}")
    return "utf-8-sig"


AS_TABLE = "write those columns that are wanted as a table, with headings in the first line"


def _other_format(head: bytes, path: Path) -> str:
    """Words for the format of a file that is no table, and for the remedy; empty where none is recognised."""
    if head.startswith(b"PK\x03\x04"):
        try:
            with zipfile.ZipFile(path) as archive:
                entries = archive.namelist()
        except (zipfile.BadZipFile, OSError, ValueError):
            entries = []
        if any(name.endswith(".npy") for name in entries):
            return "an .npz archive of numpy, not a text: numpy.savetxt writes tables"
        if any(name in ("[Content_Types].xml", "content.xml") for name in entries):
            return "a spreadsheet, not a text: save it as CSV"
        return "a zip archive: unpack it"
    for start, words in (
        (b"\x93NUMPY", "an array of numpy (.npy), not a text: numpy.savetxt writes tables"),
        (b"\x89HDF", "an HDF5 file, not a text: " + AS_TABLE),
        (b"\x1f\x8b", "compressed (gzip): unpack it"),
        (b"BZh", "compressed (bzip2): unpack it"),
        (b"\xfd7zXZ", "compressed (xz): unpack it"),
        (b"(\xb5/\xfd", "compressed (zstd): unpack it"),
        (b"%PDF", "a PDF, not a text: " + AS_TABLE),
    ):
        if head.startswith(start):
            return words
    if path.suffix.lower() == ".gsd":
        return "a GSD file, which OVITO and HOOMD read; softdyn goes on from the .npz of a run, or a table"
    if b"\0" in head:
        return "not a text: " + AS_TABLE
    lines = head.decode("utf-8", errors="replace").removeprefix("\ufeff").splitlines()
    text = "\n".join(lines).lstrip()
    counted = bool(lines) and bool(_WHOLE.fullmatch(lines[0].strip()))
    for found, words in (
        (text.startswith("ITEM:"), "a dump of LAMMPS"),
        (re.search(r"^\s*\d+\s+atoms\s*$", text, re.MULTILINE), "a data file of LAMMPS"),
        (
            counted and len(lines) > 1 and re.search(r"\b(Lattice|Properties)=", lines[1]),
            "an extended XYZ file, as ASE and OVITO write it",
        ),
        (counted and len(lines) > 2 and re.match(r"\s*[A-Za-z]\w*(\s+[-+.\d]\S*){3}", lines[2]), "an XYZ file"),
        (text.startswith("# vtk"), "a VTK file"),
        (re.match(r"(<\?xml[^>]*>\s*)?<VTKFile", text), "a VTK file"),
        (re.match(r"(CRYST1|HEADER|REMARK|ATOM  |HETATM)", text), "a PDB file"),
        (text.startswith("<"), "XML or HTML"),
        (text.startswith(("{", "[")), "JSON"),
    ):
        if found:
            return f"{words}: {AS_TABLE}"
    return ""


def _open(path: Path, encoding: str) -> TextIO:
    return path.open(encoding=encoding, newline=None)


def _bare(line: str) -> str:
    """A line without its comment."""
    return line.partition("#")[0].strip()


def _rows(path: Path, shape: Shape) -> Iterator[tuple[int, str]]:
    """Lines of numbers, each with its number."""
    with _open(path, shape.encoding) as file:
        for number, line in enumerate(islice(file, shape.first - 1, None), start=shape.first):
            if bare := _bare(line):
                yield number, bare


def _split(line: str, separator: str | None, width: int = 1) -> list[str]:
    """Cells of a line; beyond a width, without empty ones at its end."""
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    if '"' in line:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    else:
        cells = [cell.strip() for cell in line.split(separator)]
    while len(cells) > width and not cells[-1]:
        cells.pop()
    return cells


def _titles(line: str, separator: str | None) -> list[str]:
    """Cells of a line that may be headings; between spaces, units in brackets are no cells of their own."""
    return _split(_BRACKETS.sub(_joined, line.lstrip()) if separator is None else line, separator)


def _joined(unit: re.Match[str]) -> str:
    """A unit in brackets as a part of the word before it; without a word it is a remark."""
    return "\N{MIDDLE DOT}".join(unit[0].split()) if unit.start() else " "


def _starts_as_number(cell: str) -> bool:
    return bool(_NUMBER.match(cell) or _NOT_FINITE.fullmatch(cell))


def headings_of(path: str | Path, kind: str, known: Sequence[Column]) -> list[str]:
    """Headings of a table, without units; none if it has none.

    Parameters
    ----------
    path : str or Path
    kind : str
        What the table is, for errors.
    known : sequence of Column
        Columns that it may have.

    Raises
    ------
    SceneError
        If the file cannot be read as text.
    """
    path = Path(path)
    try:
        shape = _shape(path, _encoding(path, kind), known)
    except UnicodeError:
        raise SceneError(f"the {kind} {path} is not text in UTF-8: save it as such") from None
    except OSError as error:
        raise SceneError(f"cannot read the {kind} {path}: {error.strerror}") from None
    return [_UNIT.sub("", heading).strip() for heading in shape.headings or ()]


def _unit_of(heading: str) -> str:
    """The unit behind a heading, without its brackets."""
    found = _UNIT.search(heading)
    return found[1].strip("()[]/ \t") if found else ""


def _shape(path: Path, encoding: str, known: Sequence[Column]) -> Shape:
    """Tell how a table is written, by its first lines."""
    separator: str | None = None
    comments: list[str] = []
    lines: list[tuple[int, str]] = []
    with _open(path, encoding) as file:
        for number, line in enumerate(file, start=1):
            bare = _bare(line)
            if number == 1 and (said := re.fullmatch(r"sep=(.)", bare)):
                separator = said[1]  # as Excel writes it
            elif bare:
                lines.append((number, bare))
            elif not lines and line.strip().strip("#").strip():
                comments.append(line.strip().lstrip("#").strip())
            if len(lines) > LOOKED_AT:
                break
    if not lines:
        return Shape(encoding, None, {}, 1, None, 0)
    mark = separator or _separator([line for _, line in lines])
    headings, title = None, ""
    first = _titles(lines[0][1], mark)
    if not any(map(_starts_as_number, first)):
        headings, title = first, lines.pop(0)[1]
    if not lines:
        return Shape(encoding, mark, {}, number + 1, headings, len(first))
    rows = [_split(line, mark, len(headings) if headings else 1) for _, line in lines]
    if headings and len(headings) == 1 < len(rows[0]):  # they may be separated otherwise than the numbers
        others = [_titles(title, other) for other in (";", "\t", ",", None)]
        headings = next((found for found in others if len(found) == len(rows[0])), headings)
    if headings is None:
        commented = (_commented(comment, mark, len(rows[0]), known) for comment in reversed(comments))
        headings = next((found for found in commented if found), None)
    numbers = [cell for row in rows for cell in row if _NUMBER.fullmatch(cell)]
    marks = {sign: cell for cell in reversed(numbers) for sign in ",." if sign in cell}
    return Shape(encoding, mark, marks, lines[0][0], headings, len(rows[0]))


def _separator(lines: Sequence[str]) -> str | None:
    """What separates the cells of these lines: a semicolon, a tab, a comma, or None, spaces."""
    numbers = [line for line in lines if _starts_as_number(line.strip('"'))] or list(lines)
    for mark in ";\t":
        padded = mark == "\t" and any(cell.strip().endswith(",") for line in numbers for cell in line.split("\t"))
        if 2 * sum(mark in line for line in numbers) >= len(numbers) and not padded:
            return mark
    if not any("," in line for line in numbers):
        return None
    by_spaces = [line.split() for line in numbers]
    cells = [cell for row in by_spaces for cell in row]
    spaced = len({len(row) for row in by_spaces}) == 1 and len(by_spaces[0]) > 1
    if any(cell.endswith(",") for cell in cells) or not spaced:
        return ","
    return None if all(map(_NUMBER.fullmatch, cells)) or not all("," in line for line in numbers) else ","


def _commented(comment: str, mark: str | None, width: int, known: Sequence[Column]) -> list[str] | None:
    """Headings in the comment before the numbers, if it holds some."""
    if comment.startswith("format "):  # YADE: #format x_y_z_r
        cells = comment.removeprefix("format ").split("_")
    else:
        cells = _titles(comment, mark if mark and mark in comment else "," if "," in comment else None)
    bare = [_UNIT.sub("", cell) for cell in cells]
    if len(cells) != width or not all(_WORD.fullmatch(cell) for cell in bare):
        return None
    meant = any(_meaning(cell, known) for cell in bare)
    return cells if meant or (mark is not None and mark in comment) else None


def _meaning(heading: str, known: Sequence[Column]) -> str | None:
    """Name of the column that a heading means."""
    for column in known:
        for name in (column.name, *column.also):
            if heading == name or (len(name) > 1 and heading.casefold() == name.casefold()):
                return column.name
    return None


def _names(
    where: str, shape: Shape, known: Sequence[Column], order: Sequence[str] | None, besides: Sequence[str]
) -> list[str | None]:
    """What each column is; None for one that is left out."""
    there = ", ".join(column.name + (f" (or {', '.join(column.also)})" if column.also else "") for column in known)
    if shape.headings is None:
        if order is None:
            raise SceneError(f"{where}: the first line must name the columns: {there}")
        if shape.width not in (0, len(order)):
            raise SceneError(
                f"{where}, line {shape.first}: {len(order)} numbers are expected, {', '.join(order)}, and there are "
                f"{shape.width}{_hint(shape, len(order))}; headings in the first line say what is what"
            )
        return list(order)
    bare = [_UNIT.sub("", heading).strip() for heading in shape.headings]
    if shape.width != len(bare):
        raise SceneError(
            f"{where}, line {shape.first}: {shape.width} columns under {len(bare)} headings, {', '.join(bare)}"
            f"{_hint(shape, len(bare))}"
        )
    names = [_meaning(heading, known) for heading in bare]
    spellings = [name for column in known for name in (column.name, *column.also)]
    faults = []
    for number, (heading, name) in enumerate(zip(bare, names, strict=True), start=1):
        if not heading:
            faults.append(f"column {number} has no heading (pandas writes its index so, but for index=False)")
        elif name is None and heading not in besides:
            near = suggestion(heading.casefold(), spellings)
            faults.append(f"unknown column {heading!r}{near if 'mean' in near else f'; there are {there}'}")
    counts = Counter(name for name in names if name is not None)
    for name, count in counts.items():
        if count > 1:
            twice = [heading for heading, meant in zip(bare, names, strict=True) if meant == name]
            faults.append(f"{name} is there more than once: {', '.join(twice)}")
    missing = [column.name for column in known if column.needed and column.name not in counts]
    if missing:
        faults.append(f"{' and '.join(missing)} missing; the headings are {', '.join(bare)}")
    if faults:
        raise SceneError(f"{where}: {listed(faults)}")
    return names


def _hint(shape: Shape, wanted: int) -> str:
    """A guess at where another number of cells than is wanted comes from."""
    if shape.separator == "," and shape.width == 2 * wanted:
        return " (where a comma is the decimal mark, another sign must separate: ; or a tab)"
    return " (cells are separated by commas, semicolons, tabs or spaces)" if shape.width == 1 else ""


def _values(
    path: Path, kind: str, shape: Shape, names: Sequence[str | None], words: set[str]
) -> dict[str, NDArray[Any]]:
    """Columns, block by block: by numpy where every cell is plain, else cell by cell."""
    blocks: list[dict[str, NDArray[Any]]] = []
    marks = dict(shape.marks)
    number, rows = shape.first, 0
    with _open(path, shape.encoding) as file:
        lines = islice(file, shape.first - 1, None)
        while rows <= MOST_ROWS and (block := list(islice(lines, BLOCK))):
            try:
                read = _fast(block, shape, names, words)
            except ValueError:
                read = _slow(block, number, f"{kind} {path}", shape, names, words, marks)
            blocks.append(read)
            number += len(block)
            rows += len(next(iter(read.values())))
    kinds = {name: str if name in words else float for name in names if name is not None}
    return {name: np.concatenate([np.empty(0, kinds[name]), *(block[name] for block in blocks)]) for name in kinds}


def _fast(lines: list[str], shape: Shape, names: Sequence[str | None], words: set[str]) -> dict[str, NDArray[Any]]:
    """Columns of a block, by numpy; ValueError where a cell is not plain."""
    kinds = [(f"column{k}", object if name in words else float) for k, name in enumerate(names)]
    if "," in shape.marks:
        text = "".join(lines)
        if "." in text or words & set(names):
            raise ValueError
        lines = text.replace(",", ".").split("\n")
    if not any(map(_bare, lines)):
        raise ValueError  # numpy would warn
    table = np.loadtxt(lines, dtype=kinds, delimiter=shape.separator, quotechar='"', ndmin=1)
    return {
        name: np.array([cell.strip() for cell in table[kind[0]]]) if name in words else table[kind[0]]
        for name, kind in zip(names, kinds, strict=True)
        if name is not None
    }


def _slow(
    lines: list[str],
    first: int,
    where: str,
    shape: Shape,
    names: Sequence[str | None],
    words: set[str],
    marks: dict[str, str],
) -> dict[str, NDArray[Any]]:
    """Columns of a block, cell by cell: where some are quoted or lines end with a separator; or a line is at fault."""
    kept: dict[str, Any] = {name: [] if name in words else array("d") for name in names if name is not None}
    for number, line in enumerate(map(_bare, lines), start=first):
        if not line:
            continue
        cells = _split(line, shape.separator, len(names))
        if len(cells) != len(names):
            raise SceneError(
                f"{where}, line {number}: {len(names)} columns are expected, and there are {len(cells)}: {line[:80]!r}"
            )
        for name, cell in zip(names, cells, strict=True):
            if name in words:
                kept[name].append(cell)
            elif name is not None:
                kept[name].append(_number(cell, f"{where}, line {number}: {name}", marks))
    return {name: np.array(column, dtype=str if name in words else float) for name, column in kept.items()}


def _number(cell: str, where: str, marks: dict[str, str]) -> float:
    """Number in a cell; ``marks`` holds the first cell with each decimal mark, of which a table has one."""
    if _NOT_FINITE.fullmatch(cell):
        return float(cell)
    if _NUMBER.fullmatch(cell):
        for mark in ",.":
            if mark in cell:
                marks.setdefault(mark, cell)
        if len(marks) == 2:
            raise SceneError(f"{where}: {marks[',']!r} and {marks['.']!r} have different decimal marks")
        return float(cell.replace(",", "."))
    number = _NUMBER.match(cell)
    rest = cell[number.end() :].strip() if number else ""
    if not cell:
        why = "the cell is empty"
    elif re.fullmatch(r"[dD][+-]?\d+", rest):
        why = f"{cell!r} has its exponent after a D: write e"
    elif "\u2212" in cell:
        why = f"{cell!r} has a minus sign of print: write -"
    elif number and re.match(r"[.,' \u00a0\u202f]?\d", rest):
        why = f"{cell!r} is no number: digits are not grouped"
    elif number and re.match(r"[^\W\d]|[%°/]", rest):
        why = (
            f"{cell!r} is a number with a unit: numbers alone are read, all in one consistent set of units; a unit may "
            f"stand in the heading, as in {where.rpartition(' ')[2]} ({rest})"
        )
    else:
        why = f"{cell!r} is no number (a line of words in between starts with #)"
    raise SceneError(f"{where}: {why}")
