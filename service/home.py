"""Privacy of the home folder: created private, repaired if it is not, and rejected if it cannot be private.

Also sets the process default for new files. Reports and exports are stored elsewhere.
"""

from __future__ import annotations

import logging
import os
import pwd
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.machinery import (
    BYTECODE_SUFFIXES,
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    SourceFileLoader,
    SourcelessFileLoader,
)
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim.errors import HostError, UsageError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_log = logging.getLogger(__name__)
#: Robomark's files in the home. Other files there are not changed, but are inaccessible to other users, too.
_OUR_FILES = ("robomark.db*", "run", "log", "broker*", "uploads")
_PRIVATE_UMASK = 0o077
#: Root, and the number of root in a user namespace that does not map it.
_ROOT_USER_IDS = (0, 65534)
_users_umask: ContextVar[int] = ContextVar("users_umask")


def keep_files_private() -> None:
    """Make files created by this process readable only by this user, except those created ``user_permissions``."""
    if _users_umask.get(None) is None:
        _users_umask.set(os.umask(_PRIVATE_UMASK))
        # Searched first; differs from Python's loader only in the permissions.
        sys.path_hooks.insert(0, FileFinder.path_hook(*_LOADERS))
        sys.path_importer_cache.clear()


class _SharedBytecodeLoader(SourceFileLoader):
    """Loader that stores bytecode readable by all users, including a sandbox's child."""

    def set_data(self, path: str, data: ReadableBuffer, *, _mode: int = 0o666) -> None:
        """Write the bytecode with the user's normal permissions."""
        with user_permissions():
            super().set_data(path, data, _mode=_mode)


@contextmanager
def user_permissions() -> Iterator[None]:
    """Create files with the user's own umask within this context."""
    users = _users_umask.get(None)
    if users is None:
        yield
        return
    private_umask = os.umask(users)
    try:
        yield
    finally:
        os.umask(private_umask)


_LOADERS: tuple[tuple[type[Any], list[str]], ...] = (
    (ExtensionFileLoader, EXTENSION_SUFFIXES),
    (_SharedBytecodeLoader, SOURCE_SUFFIXES),
    (SourcelessFileLoader, BYTECODE_SUFFIXES),
)


def open_home(home: Path) -> None:
    """Create the home, or repair its privacy and report the repair.

    Raises UsageError if another user owns the home or could replace it, HostError if it cannot be created.
    """
    if home in (Path("/"), *_list_home_parents()):
        raise UsageError(f"the home {home} contains other files; expected a separate folder in ROBOMARK_HOME")
    try:
        _check_parents(home)
        home.mkdir(mode=0o700, parents=True, exist_ok=True)
        repaired = _make_home_private(home)
    except FileExistsError:
        raise UsageError(f"the home {home} is not a folder, expected a separate folder in ROBOMARK_HOME") from None
    except OSError as error:
        raise HostError(f"the home {error.filename or home} cannot be used: {error.strerror}") from None
    if repaired:
        _log.warning((
            "robomark: the home %s was open to other users (%d of its files and folders); now only this user has "
            "access"
        ), home, repaired)  # fmt: skip


def _list_home_parents() -> tuple[Path, ...]:
    """Return the folders that contain users' homes."""
    try:
        return tuple(Path.home().parents)
    except RuntimeError:
        return ()


def _check_parents(home: Path) -> None:
    """Check the parents of the home: an owner or writer of one of them could replace the home."""
    for path in (home, *home.parents):
        if path.is_symlink():
            _check_owner(home, path, path.lstat(), _ROOT_USER_IDS)
    for folder in dict.fromkeys((*home.parents, *home.resolve().parents)):
        if not folder.exists():
            continue
        status = folder.stat()
        _check_owner(home, folder, status, _ROOT_USER_IDS)
        if status.st_mode & stat.S_IWOTH and not status.st_mode & stat.S_ISVTX:
            raise UsageError(
                f"the home {home} is open to other users: all users can write in {folder}; expected another folder in "
                f"ROBOMARK_HOME, or chmod o-w {folder}"
            )


def _check_owner(home: Path, path: Path, status: os.stat_result, other_owners: tuple[int, ...] = ()) -> None:
    if status.st_uid not in (os.geteuid(), *other_owners):
        raise UsageError(
            f"the home {home} has another owner: {path} belongs to {_describe_user(status.st_uid)}, and Robomark runs "
            f"as {_describe_user(os.geteuid())}; run it as that user, or set another folder in ROBOMARK_HOME"
        )


def _describe_user(user: int) -> str:
    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return f"user {user}"


def _make_home_private(home: Path) -> int:
    """Make the home private, from the top down, and return the number of open paths."""
    repaired: int = _make_path_private(home, home.resolve())
    for path in sorted(found for name in _OUR_FILES for found in home.glob(name)):
        repaired += _make_path_private(home, path)
        if path.is_symlink():
            _check_owner(home, path, path.stat())
            continue
        for folder, folders, files in os.walk(path):
            repaired += sum(_make_path_private(home, Path(folder, name)) for name in (*folders, *files))
    return repaired


def _make_path_private(home: Path, path: Path) -> bool:
    """Make a path private and return whether it was open. Rejects files of other users, which would be trusted."""
    try:
        status = path.lstat()
        _check_owner(home, path, status)
        is_open = not stat.S_ISLNK(status.st_mode) and bool(status.st_mode & _PRIVATE_UMASK)
        if is_open:
            path.chmod(stat.S_IMODE(status.st_mode) & ~_PRIVATE_UMASK)
    except FileNotFoundError:
        # Services create and delete files concurrently.
        return False
    return is_open
