"""Finding a law, a closure or a potential: a stock one's name, ``path/law.py``, or ``path/law.py:name``.

Finding one imports neither the law nor sympy; :func:`load` does.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from softdyn.errors import LawError, SceneError

if TYPE_CHECKING:
    from softdyn.derive import ContactLaw
    from softdyn.derive.averaged_flow import Term
    from softdyn.derive.closure import Closure
    from softdyn.derive.potential import Potential


def package_folder(name: str) -> Path:
    """Folder of a part of softdyn, found as an import finds it, and not imported."""
    spec = importlib.util.find_spec(f"softdyn.{name}")
    assert spec is not None
    assert spec.submodule_search_locations
    return Path(next(iter(spec.submodule_search_locations)))


STOCK_FOLDER = package_folder("derive") / "laws"
CLOSURES_FOLDER = package_folder("derive") / "closures"
POTENTIALS_FOLDER = package_folder("derive") / "potentials"


@dataclass(frozen=True)
class LawReference:
    """Where a law is to be found.

    Attributes
    ----------
    shown : str
        As the user wrote it.
    path : Path or None
        A law file of the user's; None for a stock law or a law object.
    name : str
        A stock law's name, or the variable in a law file; empty if the file's only law is meant.
    law : ContactLaw or None
        The law itself, where it was handed over as an object.
    """

    shown: str
    path: Path | None
    name: str
    law: Any = None


def stock_laws() -> dict[str, str]:
    """Return names and descriptions of the stock laws, read from their files without importing them."""
    return _descriptions(STOCK_FOLDER)


def stock_closures() -> dict[str, str]:
    """Return names and descriptions of the stock closures, likewise."""
    return _descriptions(CLOSURES_FOLDER)


def stock_potentials() -> dict[str, str]:
    """Return names and descriptions of the stock potentials, likewise."""
    return _descriptions(POTENTIALS_FOLDER)


def _descriptions(folder: Path) -> dict[str, str]:
    found = {}
    for path in sorted(folder.glob("*.py")):
        if path.stem != "__init__":
            found[path.stem] = next(
                ast.literal_eval(node.value)
                for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
                if isinstance(node, ast.keyword) and node.arg == "description"
            )
    return found


@cache
def _stock_names(folder: Path) -> tuple[str, ...]:
    return tuple(path.stem for path in folder.glob("*.py") if path.stem != "__init__")


def find(law: Any) -> LawReference:
    """Resolve what the user wrote, or handed over, to a reference.

    Raises
    ------
    SceneError
        If there is no such stock law or file.
    """
    if not isinstance(law, (str, Path)):
        if type(law).__name__ != "ContactLaw":
            raise SceneError(f"law must be a name, a path or a ContactLaw, not {law!r}")
        return LawReference(law.name, None, law.name, law)
    text = str(law)
    if "\0" in text:
        raise SceneError(f"law {text!r}: a path holds a NUL character, and no file has such a name")
    file, _, name = text.rpartition(":") if ".py:" in text else (text, "", "")
    if file.endswith(".py"):
        moved = _moved.get().get(file)
        if moved is not None:
            return LawReference(text, moved, name)
        try:
            path = Path(file).expanduser().resolve()
            found = path.is_file()
        except (OSError, RuntimeError) as error:  # links that lead to themselves, an unknown ~user
            raise SceneError(f"law {text!r}: there is no such file: {error}") from None
        if not found:
            raise SceneError(f"law {text!r}: there is no file {path}")
        return LawReference(text, path, name)
    known = _stock_names(STOCK_FOLDER)
    if text in _stock_names(CLOSURES_FOLDER):
        raise SceneError(f"{text!r} is a closure, and a law is asked for; of closures there is: softdyn check {text}")
    if text in _stock_names(POTENTIALS_FOLDER):
        raise SceneError(
            f"{text!r} is a potential, and a law is asked for; it stands in [[potential]] or [[bond]] of a scene, "
            f"softdyn derive {text} tells its force, where two rest and what pulls them apart; softdyn check {text} "
            "what is proved of it near and far"
        )
    if text not in known:
        others = (*_stock_names(CLOSURES_FOLDER), *_stock_names(POTENTIALS_FOLDER))
        near = get_close_matches(text, (*known, *others), n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"softdyn has {', '.join(sorted(known))}"
        raise SceneError(f"unknown law {text!r}; {hint} (a law of your own is path/law.py or path/law.py:name)")
    return LawReference(text, None, text)


#: Files in the place of those that are named; of a task that came from elsewhere.
_moved: ContextVar[Mapping[str, Path]] = ContextVar("moved", default=MappingProxyType({}))


@contextmanager
def in_place_of(places: Mapping[str, Path]) -> Iterator[None]:
    """Context: law files that are named so are elsewhere."""
    token = _moved.set(places)
    try:
        yield
    finally:
        _moved.reset(token)


def sources_of(path: Path) -> list[Path]:
    """A law file, and the files beside it that it imports.

    Raises
    ------
    LawError, SceneError
        If it fails.
    """
    return [Path(file) for file in _declared_in(path)[1]]


def load(reference: LawReference) -> tuple[ContactLaw, dict[str, str]]:
    """Import a law, and tell the files that it depends on, besides softdyn's own, with their digests.

    A law file is Python: loading it runs it, with its folder on the import path.

    Raises
    ------
    LawError
        If the law is faulty.
    SceneError
        If the file does not define the law, or fails.
    """
    if reference.law is not None:
        return reference.law, {}
    if reference.path is None:
        return importlib.import_module(f"softdyn.derive.laws.{reference.name}").law, {}
    from softdyn.derive import ContactLaw

    declared, depends = _declared_in(reference.path)
    return _chosen(reference, declared, ContactLaw, "law"), depends


def _declared_in(path: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """What a file defines, by name, and the files that it depends on, with their digests."""
    with _folder_on_path(path.parent) as imported:
        spec = importlib.util.spec_from_file_location(f"softdyn_law_{path.stem}", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except (LawError, SceneError):
            raise
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            where = _line_in(path, error)
            raise SceneError(f"law file {path}{where}: {type(error).__name__}: {error}") from error
        depends = {str(file): digest(file) for file in {path, *imported()}}
    return vars(module), depends


def _chosen(reference: LawReference, declared: dict[str, Any], kind: type, word: str) -> Any:
    """The law, or the closure, of a file: the one that is named, else that called "law", else the only one."""
    path = reference.path
    assert path is not None
    found = {name: value for name, value in declared.items() if isinstance(value, kind)}
    if reference.name:
        if reference.name not in found:
            near = get_close_matches(reference.name, found, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"its {word}s are {', '.join(found) or 'none'}"
            raise SceneError(f"{path} defines no {word} {reference.name!r}; {hint}")
        return found[reference.name]
    if word in found:
        return found[word]
    if len({id(value) for value in found.values()}) != 1:
        said = f"several {word}s, {', '.join(found)}: name one" if found else f"no {kind.__name__}"
        raise SceneError(f"{path} defines {said}, as in {path.name}:{next(iter(found), 'name')}")
    return next(iter(found.values()))


def law_or_closure_of(name: ContactLaw | Closure | str | Path) -> ContactLaw | Closure:
    """Law, or closure, that the user wrote the name of, or handed over.

    A file that defines both is asked for the one that is named, or else for its law.

    Raises
    ------
    LawError, SceneError
        If there is neither, or if it is faulty.
    """
    if not isinstance(name, (str, Path)):
        return name if type(name).__name__ == "Closure" else law_of(name)  # type: ignore[arg-type]
    if name in _stock_names(CLOSURES_FOLDER):
        closure: Closure = importlib.import_module(f"softdyn.derive.closures.{name}").closure
        return closure
    reference = find(name)
    if reference.path is None:
        return load(reference)[0]
    from softdyn.derive import ContactLaw
    from softdyn.derive.closure import Closure

    declared, _ = _declared_in(reference.path)
    closures = [key for key, value in declared.items() if isinstance(value, Closure)]
    laws = [key for key, value in declared.items() if isinstance(value, ContactLaw)]
    if reference.name in closures or (closures and not laws and not reference.name):
        closure = _chosen(reference, declared, Closure, "closure")
        return closure
    law: ContactLaw = _chosen(reference, declared, ContactLaw, "law")
    return law


def require_known_closure(name: str) -> None:
    """Refuse what is no file, and the name of nothing.

    Raises
    ------
    SceneError
    """
    known = _stock_names(CLOSURES_FOLDER)
    if ".py" not in name and name not in (*known, *_stock_names(STOCK_FOLDER), *_stock_names(POTENTIALS_FOLDER)):
        raise _unknown("closure", name, known)


def _unknown(kind: str, name: str, known: Sequence[str]) -> SceneError:
    near = get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"softdyn has {', '.join(sorted(known))}"
    return SceneError(f"unknown {kind} {name!r}; {hint} (one of your own is path/file.py or path/file.py:name)")


def find_potential(potential: Any) -> LawReference:
    """Resolve what stands for a potential to a reference, as :func:`find` does.

    Raises
    ------
    SceneError
        If there is no such stock potential or file.
    """
    if not isinstance(potential, (str, Path)):
        if type(potential).__name__ != "Potential":
            raise SceneError(f"a potential must be a name, a path or a Potential, not {potential!r}")
        return LawReference(potential.name, None, potential.name, potential)
    if ".py" in str(potential):
        return find(potential)
    known = _stock_names(POTENTIALS_FOLDER)
    if potential not in known:
        raise _unknown("potential", str(potential), known)
    return LawReference(str(potential), None, str(potential))


def load_potential(reference: LawReference) -> tuple[Potential, dict[str, str]]:
    """Import a potential, and tell the files that it depends on, as :func:`load` does.

    Raises
    ------
    LawError, SceneError
    """
    if reference.law is not None:
        return reference.law, {}
    if reference.path is None:
        return importlib.import_module(f"softdyn.derive.potentials.{reference.name}").potential, {}
    from softdyn.derive.potential import Potential

    declared, depends = _declared_in(reference.path)
    return _chosen(reference, declared, Potential, "potential"), depends


def potential_named(name: Any) -> Potential | None:
    """The potential that is meant by what may name a law, a closure or a potential; None if it is another.

    Of a file that defines several kinds, potentials are those that are named.

    Raises
    ------
    LawError, SceneError
    """
    if not isinstance(name, (str, Path)):
        return name if type(name).__name__ == "Potential" else None
    if str(name) in _stock_names(POTENTIALS_FOLDER):
        return load_potential(find_potential(name))[0]
    if ".py" not in str(name):
        return None
    from softdyn.derive.potential import Potential

    reference = find(name)
    assert reference.path is not None
    declared, _ = _declared_in(reference.path)
    found = {key for key, value in declared.items() if isinstance(value, Potential)}
    others = {key for key, value in declared.items() if type(value).__name__ in ("ContactLaw", "Closure")}
    if reference.name in found or (found and not others and not reference.name):
        potential: Potential = _chosen(reference, declared, Potential, "potential")
        return potential
    return None


def term_of(text: str) -> Term:
    """Force on the fluid that a file declares: ``path/term.py``, or ``path/term.py:name``.

    Raises
    ------
    LawError, SceneError
        If there is no such file, or no term in it, or if it is faulty.
    """
    reference = find(text) if ".py" in text else None
    if reference is None or reference.path is None:
        raise SceneError(
            f"term {text!r}: a force on the fluid is declared in a file, path/term.py or path/term.py:name"
        )
    from softdyn.derive.averaged_flow import Term

    term: Term = _chosen(reference, _declared_in(reference.path)[0], Term, "term")
    return term


def law_of(law: ContactLaw | str | Path) -> ContactLaw:
    """Law that the user wrote the name of, or handed over.

    Raises
    ------
    LawError, SceneError
        If there is no such law, or if it is faulty.
    """
    return load(find(law))[0]


def digest(path: Path | str) -> str:
    """SHA-256 of a file; empty if it cannot be read."""
    try:
        return sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""


@contextmanager
def _folder_on_path(folder: Path) -> Iterator[Any]:
    """Import from a folder, and forget what was imported from it: next time its files may have changed.

    No bytecode is kept beside them: of files that change within a second, and keep their length, it would be the old.
    """
    before, writes_none = set(sys.modules), sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(folder))

    def new() -> list[tuple[str, Path]]:
        files = [(name, getattr(sys.modules[name], "__file__", None)) for name in set(sys.modules) - before]
        return [(name, Path(file)) for name, file in files if file and Path(file).is_relative_to(folder)]

    try:
        yield lambda: [file for _, file in new()]
    finally:
        sys.dont_write_bytecode = writes_none
        sys.path.remove(str(folder))
        for name, _ in new():
            del sys.modules[name]


def _line_in(path: Path, error: BaseException) -> str:
    if isinstance(error, SyntaxError) and error.lineno:
        return f", line {error.lineno}"
    lines = []
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(path):
            lines.append(trace.tb_lineno)
        trace = trace.tb_next
    return f", line {lines[-1]}" if lines else ""
