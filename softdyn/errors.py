"""What softdyn refuses, and why: every error a user can provoke is one of these.

The module imports nothing, so that both the derivation stage and the runtime may use it.
"""


class SoftdynError(Exception):
    """Base of all errors that softdyn raises on purpose; its text is meant for the user."""


class LawError(SoftdynError):
    """A contact law, or a weak form, is faulty; the message lists every fault found.

    Attributes
    ----------
    faults : tuple of str
        One entry for each fault.
    """

    def __init__(self, name: str, faults: tuple[str, ...], what: str = "law") -> None:
        self.faults = faults
        lines = "\n".join(f"  - {fault}" for fault in faults)
        super().__init__(f"{what} {name!r} has {len(faults)} fault{'s' if len(faults) > 1 else ''}:\n{lines}")


class SceneError(SoftdynError):
    """A scene, or a file or value that it names, cannot be used."""


class CompileError(SoftdynError):
    """A generated kernel could not be built; the message carries the command and the compiler's own words."""


class IntegrationError(SoftdynError):
    """A run could not be carried on to the asked accuracy; the message names t, h, delta and the cause.

    Attributes
    ----------
    partial : result, or None
        What a run of many particles gave up to its last good state.
    """

    partial: object = None


#: How systems say that there is not enough memory to load a library, or to start a process.
_OF_MEMORY = ("failed to map segment", "cannot allocate memory", "not enough memory", "memoryerror")


def lacks_memory(words: object) -> bool:
    """Whether an error, by its words and those of its causes, is one of too little memory."""
    said = [str(words)]
    while isinstance(words, BaseException):
        words = words.__cause__ or words.__context__
        said.append(str(words))
    return any(part in one.casefold() for one in said for part in _OF_MEMORY)


def pressed_only_words(law: str) -> str:
    """What ends a run where surfaces of a law that knows none that are pulled would be."""
    return (
        f"law {law!r} is defined for delta >= 0 alone, its elastic force being no real number for delta < 0, and here "
        "the surfaces would be pulled: write abs(delta) where it is to hold in tension, too, or end the run earlier"
    )
