"""Carrying a run to its end; whatever ends it before, what it has is kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softdyn.errors import IntegrationError
from softdyn.signals import held_back, terminable

#: Seconds between two checkpoints.
CHECKPOINT_EVERY = 30.0


def carried(
    go: Callable[[Callable[[], None] | None], None],
    checkpoint: Path | None,
    save: Callable[[], None],
    partial: Callable[[], Any],
    now: Callable[[], float],
) -> None:
    """Carry a run to its end.

    Parameters
    ----------
    go : function of a function
        Does it; with a checkpoint it calls what it is given after each step, else it is given None.
    checkpoint : Path, optional
        Where the state is kept: now and then, at an interrupt (SIGINT, or SIGTERM), and where the run cannot go on.
    save : function
        Writes it.
    partial : function
        The result so far; None if there is none.
    now : function
        The time that the run has reached.

    Raises
    ------
    IntegrationError
        If it cannot be carried to its end. Its attribute ``partial`` is the result up to the last good state.
    """
    if checkpoint is None:
        try:
            go(None)
        except IntegrationError as error:
            error.partial = partial()
            raise
        return
    last = time.monotonic()
    with terminable():
        try:
            with held_back() as let_go:

                def after_step() -> None:
                    nonlocal last
                    if time.monotonic() - last > CHECKPOINT_EVERY:
                        save()
                        last = time.monotonic()
                    let_go()

                go(after_step)
        except IntegrationError as error:
            error.partial = partial()
            if error.partial is None:
                raise
            save()
            stopped = IntegrationError(f"{error}; the last good state, at t={now():.6g}, is in {checkpoint}")
            stopped.partial = error.partial
            raise stopped from None
        except KeyboardInterrupt:
            save()
            raise
