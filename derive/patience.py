"""An end to what may have none: sympy cannot be told how long it may take.

Input: a deadline. Output: an exception in the thread that has passed it, wherever it is in Python code.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread, get_ident
from time import process_time
from typing import Any

#: Seconds after which the exception is raised again, if something has caught it.
AGAIN = 0.25


@contextmanager
def until(deadline: float, over: type[Exception]) -> Iterator[None]:
    """Raise an exception in this thread once the process has used its time.

    Parameters
    ----------
    deadline : float
        Of :func:`time.process_time`.
    over : type of Exception
    """
    if process_time() > deadline:
        raise over
    if deadline == float("inf"):
        yield
        return
    target, done = ctypes.c_ulong(get_ident()), Event()

    def watch() -> None:
        while not done.wait(max(AGAIN, deadline - process_time())):
            if process_time() > deadline:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(target, ctypes.py_object(over))

    told = sys.unraisablehook

    def hold(info: Any) -> None:
        """Say nothing of our exception where Python cannot raise it, as in a finalizer: it comes again."""
        if not isinstance(info.exc_value, over):
            told(info)

    watching = Thread(target=watch, daemon=True)
    sys.unraisablehook = hold
    watching.start()
    try:
        yield
    finally:
        sys.unraisablehook = told
        done.set()
        watching.join()
        # one that was raised but has not arrived
        ctypes.pythonapi.PyThreadState_SetAsyncExc(target, None)
