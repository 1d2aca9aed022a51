"""What may have no end is given one, in operations: the same on any machine."""

from __future__ import annotations

import pytest
from sympy import Integer, symbols

from softdyn.derive.patience import nodes, spend, within


class OverError(Exception):
    """More operations were taken than are allowed."""


class InnerError(Exception):
    """The same, of work within other work."""


def work(rounds: int) -> int:
    for done in range(rounds):
        try:
            spend(3)
        except (OverError, InnerError):
            return done
    return rounds


def test_what_does_not_end_is_ended_at_the_same_operation() -> None:
    for _ in range(3):
        with within(100, OverError):
            assert work(10**6) == 33


def test_what_nobody_limits_is_not_ended() -> None:
    assert work(1000) == 1000
    with within(None, OverError):
        assert work(1000) == 1000


def test_work_within_work_has_what_is_left_at_most() -> None:
    with within(100, OverError):
        with within(30, InnerError):
            assert work(10**6) == 10
        with pytest.raises(InnerError), within(10**6, InnerError):
            spend(70)
        with pytest.raises(OverError):
            spend(1)


def test_what_was_over_within_stays_over_for_the_work_around_it() -> None:
    with within(10, OverError):
        with pytest.raises(InnerError), within(1000, InnerError):
            spend(1000)
        with pytest.raises(OverError):
            spend()


def test_an_expression_is_as_large_as_its_tree() -> None:
    x, y = symbols("x y")
    assert nodes(x) == 1
    assert nodes(x**2 + y) == 5  # the sum, the power, x, 2, y
    deep = x
    for _ in range(60):
        deep = deep * (deep + Integer(1))  # shared parts count each time that they stand there
    assert nodes(deep) > 2**60
