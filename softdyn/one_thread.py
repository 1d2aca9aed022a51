"""Linear algebra in one thread: with more, sums are split otherwise, and last digits would depend on the machine."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

Given = ParamSpec("Given")
Made = TypeVar("Made")


def in_one_thread(function: Callable[Given, Made]) -> Callable[Given, Made]:
    """Hold BLAS to one thread while a function runs."""

    @wraps(function)
    def held(*given: Given.args, **named: Given.kwargs) -> Made:
        with threadpool_limits(limits=1, user_api="blas"):
            return function(*given, **named)

    return held
