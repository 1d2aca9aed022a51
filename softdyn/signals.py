"""Signals that ask a process to end: SIGINT and SIGTERM."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Terminated(KeyboardInterrupt):
    """SIGTERM was received: what is done on an interrupt is done."""


@contextmanager
def terminable() -> Iterator[None]:
    """Within it SIGTERM raises :class:`Terminated`, once, as SIGINT raises KeyboardInterrupt.

    Only in the main thread, and where nobody else has said what SIGTERM does.
    """
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def stop(*_: object) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # what is being written is written
        raise Terminated

    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold both signals back until its end: what is done within it is done whole, or not at all."""
    # they come to the main thread alone, and to Python's handlers
    mine = threading.current_thread() is threading.main_thread()
    usual = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)} if mine else {}
    usual = {number: handler for number, handler in usual.items() if callable(handler)}
    came: list[int] = []
    for number in usual:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])


@contextmanager
def held_back() -> Iterator[Callable[[], None]]:
    """Within it both signals wait until the function that it gives is called; a second SIGINT does not.

    So what is in the middle of something comes to its end, but a user who insists is heard. SIGTERM may come twice
    from one cause, as from a pool of processes that ends: what sends it and cannot wait sends SIGKILL.
    """
    mine = threading.current_thread() is threading.main_thread()
    usual = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)} if mine else {}
    usual = {number: handler for number, handler in usual.items() if callable(handler)}
    came: list[int] = []

    def let_go() -> None:
        if came:
            number = came[-1]
            restore()
            signal.raise_signal(number)

    def restore() -> None:
        for number, handler in usual.items():
            signal.signal(number, handler)
        usual.clear()  # what they do from then on may change
        came.clear()

    def wait(number: int, _: object) -> None:
        came.append(number)
        if came.count(signal.SIGINT) > 1:
            let_go()

    for number in usual:
        signal.signal(number, wait)
    try:
        yield let_go
        let_go()
    finally:
        restore()
