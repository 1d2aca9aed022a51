"""The kernel cache: a folder of the user's own, safe when processes race.

Every entry is a folder named by its key, holding files and ``entry.json`` with their digests. It is written under
another name and renamed, so that it is there whole or not at all; whatever does not match its digests is a miss.

What is in it is run. So nobody else may be able to write at any of its levels, the cache, the folder of a kind and the
entry, nor to put another folder in the place of one of those above: what others could have written is refused by name.
"""

from __future__ import annotations

import json
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache as memoize
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

from softdyn.errors import SceneError

VARIABLE = "SOFTDYN_CACHE_DIR"
#: What Windows says of a file that another process has locked: EACCES, and EDEADLOCK after ten seconds.
LOCKED = (13, 36)
#: See :func:`stand_of`.
Stand = tuple[tuple[int, ...], tuple[int, ...], tuple[tuple[Any, ...], ...]]
#: Permissions to write, of the group and of everybody else.
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def folder() -> Path:
    """Return the cache's folder, made with access for its owner only.

    Raises
    ------
    SceneError
        If it cannot be made, belongs to somebody else, or others can write to it or replace it.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen:
        path = _absolute(chosen) if os.path.isabs(chosen) else Path(chosen).expanduser().absolute()
    else:
        import platformdirs

        path = Path(platformdirs.user_cache_path("softdyn", appauthor=False))
    try:
        with suppress(FileNotFoundError):
            if _safe.get(path) == _permissions(path):
                return path
        _make(path)
        require_own(path.resolve(), "the kernel cache")
        _require_safe_way(path)
        permissions = _permissions(path)
        if not any(stat.S_ISLNK(mode) for mode, _ in permissions):  # where links lead can change unseen
            _safe[path] = permissions
    except OSError as error:
        raise SceneError(
            f"cannot make the kernel cache {path}: {error.strerror}; set {VARIABLE} to another folder"
        ) from None
    return path


#: Caches that this process has found safe, with the permissions and owners of their folder and of those above it.
_safe: dict[Path, tuple[tuple[int, int], ...]] = {}


@memoize
def _absolute(path: str) -> Path:
    return Path(path)


def _permissions(path: Path) -> tuple[tuple[int, int], ...]:
    return tuple((info.st_mode, info.st_uid) for info in map(os.lstat, _levels(path)))


@memoize
def _levels(path: Path) -> tuple[str, ...]:
    """A folder and those above it, as the system takes them."""
    return tuple(map(str, (path, *path.parents)))


def _make(path: Path) -> None:
    """Make a folder and those above it that are missing, for their owner only, whatever the umask."""
    if path.is_dir():
        return
    missing = [one for one in (path, *path.parents) if not one.exists()]
    for one in reversed(missing):
        one.mkdir(mode=0o700, exist_ok=True)
    if not path.is_dir():
        raise NotADirectoryError(20, "it is a file")


def require_own(path: Path, what: str) -> None:
    """Refuse what another user owns, what others can write to, and a link, which may lead to either.

    Parameters
    ----------
    path : Path
        A file or folder whose content is run.
    what : str
        What it is, for the message.

    Raises
    ------
    SceneError
        Naming it, its permissions and the remedy.
    OSError
        If it is not there.
    """
    if not hasattr(os, "getuid"):
        return
    info = path.lstat()
    own = f"set {VARIABLE} to a folder of your own"
    if stat.S_ISLNK(info.st_mode):
        raise SceneError(f"{what} {path} is a link to {os.readlink(path)}, and what is there would be run: remove it")
    if info.st_uid != os.getuid():
        raise SceneError(f"{what} {path} belongs to another user; {own}")
    if info.st_mode & OTHERS_WRITE:
        raise SceneError(
            f"{what} {path} can be written by others (mode {stat.S_IMODE(info.st_mode):04o}), whose code would then be "
            f"run: remove it (rm -r), or, if nobody was there, chmod go-w; or {own}"
        )


def _require_safe_way(path: Path) -> None:
    """Refuse a cache below a folder in which somebody else may rename what is there.

    Folders above belong to the user, to root, or to whom the root of the file system belongs to (in containers that is
    neither); others may write to them only where the sticky bit keeps them from what is not their own. Links on the way
    are followed, one by one.
    """
    if not hasattr(os, "getuid"):
        return
    trusted = {os.getuid(), 0, Path(path.anchor).stat().st_uid}
    todo = [*path.parents, *([path] if path.is_symlink() else [])]
    seen: set[Path] = set()
    while todo:
        part = todo.pop()
        if part in seen:
            continue
        seen.add(part)
        info = part.lstat()
        if info.st_uid not in trusted:
            raise SceneError(
                f"the kernel cache {path} lies below {part}, which belongs to another user, who could replace it; set "
                f"{VARIABLE} to a folder of your own"
            )
        if stat.S_ISLNK(info.st_mode):
            target = part.parent / os.readlink(part)
            todo += [target, *target.parents]
        elif info.st_mode & OTHERS_WRITE and not info.st_mode & stat.S_ISVTX and not _of_one_user(info):
            raise SceneError(
                f"the kernel cache {path} lies below {part}, where others can replace it (mode "
                f"{stat.S_IMODE(info.st_mode):04o}), and have their code run: chmod go-w {part}, or set {VARIABLE} to "
                "a folder of your own"
            )


def _of_one_user(info: os.stat_result) -> bool:
    """Whether only the group may write, and it is the owner's private one, as many systems make one for each user."""
    if info.st_mode & stat.S_IWOTH:
        return False
    try:
        import grp
        import pwd

        group, owner = grp.getgrgid(info.st_gid), pwd.getpwuid(info.st_uid)
    except (ImportError, KeyError):
        return False
    return group.gr_name == owner.pw_name and set(group.gr_mem) <= {owner.pw_name}


def _require_own_entry(path: Path, published: Mapping[str, str]) -> None:
    """Refuse an entry that others could have written to, or that leads elsewhere."""
    require_own(path, "the entry of the kernel cache")
    for name in published:
        require_own(path / name, "the file of the kernel cache")
    entered = path.stat().st_mode & (stat.S_IXGRP | stat.S_IXOTH)
    for one in path.rglob("*"):
        # what compilers add follows the umask, and nobody else comes to it
        if one.name not in published and (entered or one.is_symlink() or one.is_dir()):
            with suppress(FileNotFoundError):  # another process may be at work
                require_own(one, "the file of the kernel cache")


def key_of(*parts: Any) -> str:
    """Key of an entry: a digest of everything that it depends on."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return sha256(text.encode()).hexdigest()[:32]


def read(kind: str, key: str) -> Path | None:
    """Folder of an entry, if it is there and whole.

    Raises
    ------
    SceneError
        If others can write at any level of it.
    """
    path = folder() / kind / key
    try:
        stand = stand_of(path)
        if found_as(path) == stand:
            return path
        require_own(path.parent, "the folder of the kernel cache")
        require_own(path, "the entry of the kernel cache")
        noted = _read_note(path)
        digests: Mapping[str, str] = noted["digests"]
        if not isinstance(digests, dict):
            return None
        _require_own_entry(path, {**digests, "entry.json": ""})
        for name, expected in digests.items():
            if sha256((path / name).read_bytes()).hexdigest() != expected:
                return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    _whole[path] = stand, noted
    return path


#: Entries that this process has found whole: how they then stood, and what was noted of them.
_whole: dict[Path, tuple[Stand, Mapping[str, Any]]] = {}


def found_as(path: Path) -> Stand | None:
    """How an entry stood when :func:`read` last found it whole: while that is so, nothing in it has changed."""
    known = _whole.get(path)
    return None if known is None else known[0]


def stand_of(path: Path) -> Stand:
    """How an entry stands on the disk: what changes if anybody writes to it, replaces it, or changes its permissions.

    Raises
    ------
    OSError
        If it is not there.
    """
    above, own = os.lstat(path.parent), os.lstat(path)
    with os.scandir(path) as files:
        inside = sorted((file.name, *_of_file(file.stat(follow_symlinks=False))) for file in files)
    return (above.st_mode, above.st_uid), _of_file(own), tuple(inside)


def _of_file(info: os.stat_result) -> tuple[int, ...]:
    # the time of the last change of a file is the system's: nobody can set it back
    return info.st_mode, info.st_uid, info.st_ino, info.st_size, info.st_mtime_ns, info.st_ctime_ns


def note(entry: Path) -> Mapping[str, Any]:
    """What was noted of an entry as it was published, which :func:`read` has found whole."""
    return _whole[entry][1] if entry in _whole else _read_note(entry)


def _read_note(entry: Path) -> Mapping[str, Any]:
    noted: Mapping[str, Any] = json.loads((entry / "entry.json").read_text(encoding="utf-8"))
    return noted


def publish(
    kind: str, key: str, files: Mapping[str, bytes], note: Mapping[str, Any] | None = None, replace: bool = False
) -> Path:
    """Store an entry and return its folder.

    Where another process was faster, its entry is kept, unless ``replace`` says that what is there is out of date.

    Parameters
    ----------
    kind : str
        Folder that the entry is in.
    key : str
        Its name there.
    files : mapping from str to bytes
        What it holds, by names of files.
    note : mapping, optional
        Plain data to note of it in ``entry.json``.
    replace : bool
        Whether an entry of this name that is there is out of date.

    Raises
    ------
    SceneError
        If it cannot be written.
    """
    parent = folder() / kind
    target = parent / key
    _whole.pop(target, None)
    try:
        parent.mkdir(mode=0o700, exist_ok=True)
        require_own(parent, "the folder of the kernel cache")
        made = Path(tempfile.mkdtemp(prefix=".", dir=parent))
        try:
            digests = {name: sha256(content).hexdigest() for name, content in files.items()}
            entry = json.dumps({"digests": digests, **(note or {})}, indent=1)
            for name, content in {**files, "entry.json": entry.encode()}.items():
                (made / name).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                with open(os.open(made / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                    file.write(content)
            try:
                made.rename(target)
            except OSError:
                _put_in_place(kind, key, made, replace)
        finally:
            shutil.rmtree(made, ignore_errors=True)
    except OSError as error:
        raise SceneError(
            f"cannot write the kernel cache {parent}: {error.strerror}; set {VARIABLE} to another folder"
        ) from None
    return target


def evict(kind: str, key: str) -> None:
    """Take an entry out that turned out to be of no use; that of another process's may be there at once."""
    target = folder() / kind / key
    _whole.pop(target, None)
    with suppress(OSError), _locked(folder() / f"{kind}.lock"):
        aside = Path(tempfile.mkdtemp(prefix=".", dir=target.parent))
        try:
            target.rename(aside / "old")
        finally:
            shutil.rmtree(aside, ignore_errors=True)


def _put_in_place(kind: str, key: str, made: Path, replace: bool) -> None:
    """Put a new entry in the place of a damaged one, or of any; else a whole one, of another process's, stays."""
    target = folder() / kind / key
    with _locked(folder() / f"{kind}.lock"):
        if not replace and read(kind, key) is not None:
            return
        aside = Path(tempfile.mkdtemp(prefix=".", dir=target.parent))
        try:
            target.rename(aside / "old")
            made.rename(target)
        except OSError:
            if read(kind, key) is None:  # else it was published in this very moment
                raise
        finally:
            shutil.rmtree(aside, ignore_errors=True)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Only one process at a time. The lock goes with the process, however it ends."""
    with path.open("ab") as file:
        let_go = _lock(file)
        try:
            yield
        finally:
            let_go()


def _lock(file: BinaryIO) -> Callable[[], object]:
    """Wait for a lock on a file; what is given lets it go."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(0)
        while True:
            try:
                msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
                break
            except OSError as error:  # it waits for ten seconds alone
                if error.errno not in LOCKED:
                    raise

        def let_go() -> None:
            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)

        return let_go
    import fcntl

    fcntl.flock(file, fcntl.LOCK_EX)
    return lambda: None  # closing the file does it
