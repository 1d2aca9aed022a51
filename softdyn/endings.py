"""How the command line ends: one status for each kind of end, and one message for whatever goes wrong.

Errors of softdyn's own carry their message. What is left, from too little memory to a fault in softdyn itself, is
turned into one here, and nowhere else; no traceback reaches the terminal.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TextIO

import softdyn
from softdyn.errors import SoftdynError, lacks_memory
from softdyn.signals import Terminated, terminable

DONE, REFUTED, REFUSED, EXHAUSTED, FAULT, INTERRUPTED, TERMINATED = 0, 1, 2, 3, 70, 130, 143
STATUSES = """
exit status:
  0    done, or the reader of the output went away (as with | head)
  1    a limit is not proved, a generated file would change, runs of a sweep failed, or something is wrong under stress
  2    wrong input, a file that cannot be read or written, or a run that cannot be carried to its end
  3    too little memory, or expressions nested too deeply for it
  70   a fault of softdyn's own: the message says where its traceback is
  130  interrupted (SIGINT); 143 terminated (SIGTERM): a run with -o, a sweep and a bench keep what they have
whatever is not 0 or 1 comes with one message on stderr
"""


def ended(command: Callable[[], int], arguments: Sequence[str], goes_on: Callable[[], str]) -> int:
    """Carry out a command, tell on stderr what stopped it, and return its exit status.

    Parameters
    ----------
    command : function that returns a status
    arguments : sequence of str
        Of the command line, for reports of faults.
    goes_on : function that returns text
        How a command that was interrupted goes on; empty if it starts anew.
    """
    try:
        with terminable(), warnings.catch_warnings():
            warnings.showwarning = _tell_warning
            status = command()
            sys.stdout.flush()
            return status
    except BrokenPipeError:
        _leave_stdout()
        return DONE
    except Terminated:
        return _told(f"terminated{goes_on()}", TERMINATED)
    except KeyboardInterrupt:
        return _told(f"interrupted{goes_on()}", INTERRUPTED)
    except Exception as error:
        if isinstance(error, OSError) and error.filename is None:  # of no file: stdout cannot be written
            _leave_stdout()
        status, message = explained(error, arguments)
        return _told(f"error: {message}", status)


def _tell_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Tell what a library warns of as softdyn tells its own warnings: in one line, without code."""
    words = " ".join(str(message).split())
    print(f"softdyn: warning: {words} ({category.__name__}, {os.path.basename(filename)}:{lineno})", file=sys.stderr)


def _told(message: str, status: int) -> int:
    print(f"softdyn: {message}", file=sys.stderr)
    return status


def _leave_stdout() -> None:
    """Let what is left in the buffer of stdout go nowhere: nobody reads it, or it cannot be written."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def explained(error: Exception, arguments: Sequence[str] = ()) -> tuple[int, str]:
    """Exit status and message of an error."""
    if isinstance(error, SoftdynError):
        return REFUSED, str(error)
    if isinstance(error, MemoryError) or (isinstance(error, (ImportError, OSError)) and lacks_memory(error)):
        said = f": {error}" if isinstance(error, MemoryError) and str(error) else ""
        return EXHAUSTED, f"there is not enough memory for this{said}; ask for fewer outputs, runs or particles"
    if isinstance(error, RecursionError):
        return EXHAUSTED, "an expression is nested too deeply: write it in fewer levels, or a sum as a table"
    if type(error).__name__ == "BrokenProcessPool":  # whose module is imported where there is a pool
        return EXHAUSTED, "a process that shares the work was ended from outside, as for lack of memory; run it again"
    if isinstance(error, OSError):
        return REFUSED, f"{error.strerror or error}{f': {error.filename}' if error.filename else ''}"
    if isinstance(error, ValueError) and "embedded null" in str(error):
        return REFUSED, "a path holds a NUL character, and no file has such a name"
    return FAULT, _fault(error, arguments)


def _fault(error: Exception, arguments: Sequence[str]) -> str:
    """Message of a fault in softdyn, whose traceback is put into a file."""
    report = (
        f"softdyn {softdyn.__version__}, Python {platform.python_version()}, {platform.platform()}\n"
        f"arguments: {list(arguments)!r}\n\n{''.join(traceback.format_exception(error))}"
    )
    words = " ".join(str(error).split())[:200] or "no more is said"
    said = f"a fault of softdyn's own, {type(error).__name__}: {words}"
    try:
        handle, name = tempfile.mkstemp(prefix="softdyn-fault-", suffix=".txt")
        with open(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
            file.write(report)
    except OSError:
        return f"{said}\nplease report it with what follows, and with the files that it was given\n{report}"
    return f"{said}; please report it with {name}, which holds the traceback, and with the files that it was given"
