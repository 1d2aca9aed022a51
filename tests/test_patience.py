"""What may have no end is given one, wherever it is."""

from __future__ import annotations

from time import process_time

import pytest

from softdyn.derive.patience import until


class OverError(Exception):
    """The time is over."""


def busy(seconds: float) -> None:
    end = process_time() + seconds
    while process_time() < end:
        pass


def test_what_does_not_end_is_ended() -> None:
    start = process_time()
    with pytest.raises(OverError), until(start + 0.1, OverError):
        busy(60)
    assert process_time() - start < 5


def test_where_python_cannot_raise_nothing_is_said_and_it_ends_afterwards(capsys: pytest.CaptureFixture[str]) -> None:
    """An exception within a finalizer, or a callback of the garbage collector, is dropped and printed by Python."""
    ended = []

    class Slow:
        def __del__(self) -> None:
            try:
                busy(1.0)
            finally:
                ended.append(process_time())

    def work() -> None:
        slow = Slow()
        del slow
        busy(60)

    start = process_time()
    with pytest.raises(OverError), until(start + 0.3, OverError):
        work()
    assert ended[0] - start < 1.0, "the time was not over within the finalizer"
    assert process_time() - start < 5
    assert capsys.readouterr().err == ""
