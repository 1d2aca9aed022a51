"""Words that messages about input share."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches


def suggestion(word: object, known: Sequence[str]) -> str:
    """Words to add to a message about an unknown name."""
    near = get_close_matches(str(word), list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; there are {', '.join(known)}"


def listed(faults: Sequence[str]) -> str:
    """One fault as it is, more than one a line each."""
    return faults[0] if len(faults) == 1 else "\n" + "\n".join(f"  - {fault}" for fault in faults)


def in_columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of words as lines, in columns; the last is as wide as it likes."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    return "\n".join("  ".join(map(str.ljust, row, (*widths, 0))) for row in rows)
