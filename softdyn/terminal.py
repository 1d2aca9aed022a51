"""What is written to a terminal: plain text, whatever words of others are in it.

A law's name, its limits, a message of a law file or of a compiler may hold what a terminal obeys: escape sequences,
carriage returns, marks that reverse the order of letters. They are shown, as Python writes them, and not obeyed.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast

#: Controls but tab and line feed, marks without width, separators of lines, orders of direction, halves of characters.
OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff]")


def plain(text: str) -> str:
    """Text in which nothing is left that a terminal obeys."""
    return OBEYED.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class PlainStream:
    """A text stream to which only plain text is written, in signs that its encoding has.

    Parameters
    ----------
    stream : text stream
    quiet : bool
        Whether what cannot be written is left out: of messages on stderr there is no other place to tell.
    """

    def __init__(self, stream: TextIO, quiet: bool = False) -> None:
        self.stream, self.quiet = stream, quiet

    def write(self, text: str) -> int:
        """Write text, with what a terminal would obey spelled out."""
        text = plain(text)
        with suppress(*((OSError, ValueError) if self.quiet else ())):
            try:
                self.stream.write(text)
            except UnicodeEncodeError as error:
                self.stream.write(text.encode(error.encoding, "backslashreplace").decode(error.encoding))
        return len(text)

    def flush(self) -> None:
        """Flush the stream."""
        with suppress(*((OSError, ValueError) if self.quiet else ())):
            self.stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def as_it_is(stream: Any) -> TextIO:
    """Stream beneath, for what draws on the terminal on purpose."""
    return cast(TextIO, stream.stream if isinstance(stream, PlainStream) else stream)


@contextmanager
def plain_streams() -> Iterator[None]:
    """Within it stdout and stderr take plain text alone; where one is closed, what is written to it goes nowhere."""
    before = sys.stdout, sys.stderr
    if None in (sys.stdin, *before):
        # lest a file that is opened later takes the number of a closed stream, and what is written to it
        while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(handle)
    nowhere = open(os.devnull, "w", encoding="utf-8") if None in before else None  # noqa: SIM115
    out, err = (cast(TextIO, nowhere if stream is None else stream) for stream in before)
    sys.stdout, sys.stderr = cast(TextIO, PlainStream(out)), cast(TextIO, PlainStream(err, quiet=True))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
        if nowhere is not None:
            nowhere.close()
