"""The kernel's layers, put up by a process round itself: Landlock for files, a seccomp filter for everything else.

Both are needed: Landlock knows files but not the network, seccomp knows system calls but not files. There is no way
back, and neither needs a privilege. Which calls are allowed is in ``system_calls.py``.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import fcntl
import hashlib
import os
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from .system_calls import asking, program

_libc = ctypes.CDLL(None, use_errno=True)

_PR_SET_NO_NEW_PRIVS = 38
_PERSONALITY_AS_IT_IS, _ADDR_NO_RANDOMIZE = 0xFFFFFFFF, 0x40000
_SYS_CAPGET, _SYS_CAPSET = 125, 126
_CAPABILITIES = struct.pack("=Ii", 0x20080522, 0)  # the third version of the interface, this process
_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID = 0, 1, 5, 6, 7
_SYS_SECCOMP = 317
_NEW_LISTENER, _ANSWERED_BEFORE_SIGNALS = 8, 32  # the second from Linux 5.19
_SYS_LANDLOCK_CREATE_RULESET = 444
_SYS_LANDLOCK_ADD_RULE = 445
_SYS_LANDLOCK_RESTRICT_SELF = 446

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_REMOVE_FILE, _MAKE_REG, _TRUNCATE = 1 << 5, 1 << 8, 1 << 14
_FILE_ONLY = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE

#: All file rights that each version of Landlock's interface knows (linux/landlock.h).
_FILE_RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 4: (1 << 15) - 1, 5: (1 << 16) - 1}
_RULE = struct.Struct("=Qi")  # rights, and the descriptor of what they are on
#: The first number of descriptors that stay open for ``reading_rules``.
ABOVE = 256
_NETWORK_RIGHTS = 0b11  # bind and connect TCP, from version 4
_SCOPES = 0b11  # abstract sockets and signals, from version 6


class LayerMissing(Exception):
    """A layer that cannot be put up here; the text names it and what the system said."""


@dataclass(frozen=True)
class Grants:
    """What stays reachable: files and folders to read, and folders to list."""

    read: tuple[str, ...]
    list_only: tuple[str, ...] = ()
    open_to_others: bool = False  # whether a user who owns nothing could read them
    without: tuple[str, ...] = ()  # modules that student code does without


def landlock_version() -> int:
    """The version of Landlock's interface, 0 if the kernel has none or has it switched off."""
    version = _libc.syscall(_SYS_LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(1))
    return max(int(version), 0)


def control(option: int, value: int) -> None:
    """One of the process's own settings, see prctl(2)."""
    _libc.prctl(option, value, 0, 0, 0)


def run_on(processors: bytes) -> None:
    """Keep this process to some processors: a bit each, see sched_setaffinity(2)."""
    _libc.sched_setaffinity(0, ctypes.c_size_t(len(processors)), processors)


def has_fixed_addresses() -> bool:
    """Whether this process has its memory at the same addresses as any other that did the same."""
    personality = _libc.personality(ctypes.c_ulong(_PERSONALITY_AS_IT_IS))
    return personality >= 0 and bool(personality & _ADDR_NO_RANDOMIZE)


def forbid_new_privileges() -> None:
    """No set-uid program can lift the sandbox."""
    if _libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise LayerMissing(f"no_new_privs: {_last_error()}")


def drop_capabilities() -> None:
    """Root keeps its name and loses its powers: no mounts, no raw sockets, no pages taken from the machine."""
    if _libc.syscall(_SYS_CAPSET, _CAPABILITIES, bytes(24)) != 0:
        raise LayerMissing(f"capset: {_last_error()}")


def may_change_user() -> bool:
    """Whether this process can become somebody else, and its parent can still end it and tidy up after it."""
    sets = ctypes.create_string_buffer(24)
    if os.geteuid() != 0 or _libc.syscall(_SYS_CAPGET, _CAPABILITIES, sets) != 0:
        return False
    effective = struct.unpack_from("=I", sets)[0]
    return all(effective >> power & 1 for power in (_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID))


def become(user: int) -> None:
    """Be ``user``, and in no group but its own. Raises LayerMissing."""
    try:
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
    except OSError as error:
        raise LayerMissing(f"own user: {error.strerror}") from None


def reading_rules(grants: Grants) -> tuple[bytes, ...]:
    """``grants`` as Landlock is told of them. The files stay open, so that a fork need not look for them again."""
    rights = {**dict.fromkeys(grants.read, _READ_FILE | _READ_DIR), **dict.fromkeys(grants.list_only, _READ_DIR)}
    return tuple(rule for path, allowed in rights.items() for rule in _rules_for(path, allowed))


def _rules_for(path: str, rights: int) -> Iterator[bytes]:
    with contextlib.suppress(FileNotFoundError):
        fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
        yield _RULE.pack(rights if os.path.isdir(path) else rights & _FILE_ONLY, _moved(fd))


def _moved(fd: int) -> int:
    """The descriptor under another number, above those that a child uses."""
    try:
        return fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, ABOVE)
    finally:
        os.close(fd)


def writing_rule(folder: int, most: int = 99) -> bytes:
    """That the flat folder with this descriptor may be written in, as version ``most`` is told at most."""
    own = _READ_FILE | _READ_DIR | _WRITE_FILE | _MAKE_REG | _REMOVE_FILE | _TRUNCATE
    return _RULE.pack(own & _file_rights(min(landlock_version(), most)), folder)


def restrict_files(rules: Iterable[bytes], most: int = 99) -> int:
    """Let this process reach nothing but what ``rules`` allow; at most version ``most`` is used. That in force."""
    version = min(landlock_version(), most)
    if version < 1:
        raise LayerMissing(
            "Landlock: the kernel does not have it or it is switched off (needs 5.13 with landlock in lsm=)"
        )
    ruleset = _create_ruleset(_file_rights(version), version)
    try:
        for rule in rules:
            if _libc.syscall(_SYS_LANDLOCK_ADD_RULE, ruleset, 1, rule, 0) != 0:
                raise LayerMissing(f"Landlock: {_last_error()}")
        if _libc.syscall(_SYS_LANDLOCK_RESTRICT_SELF, ruleset, 0) != 0:
            raise LayerMissing(f"Landlock: {_last_error()}")
    finally:
        os.close(ruleset)
    return version


def _file_rights(version: int) -> int:
    return _FILE_RIGHTS.get(min(version, 5), 0)


def _create_ruleset(rights: int, version: int) -> int:
    sizes = {1: 8, 2: 8, 3: 8, 4: 16, 5: 16}
    attribute = struct.pack("=QQQ", rights, _NETWORK_RIGHTS, _SCOPES)
    wanted = [sizes.get(version, 24), 16, 8] if version >= 4 else [8]
    for size in wanted:
        # Some kernels claim a version whose scopes they lack: then the same without them.
        ruleset = _libc.syscall(_SYS_LANDLOCK_CREATE_RULESET, attribute[:size], ctypes.c_size_t(size), 0)
        if ruleset >= 0:
            return int(ruleset)
        if ctypes.get_errno() != errno.EINVAL:
            break
    raise LayerMissing(f"Landlock: {_last_error()}")


def _last_error() -> str:
    return os.strerror(ctypes.get_errno())


def restrict_system_calls() -> None:
    """Install the filter on this process, for ever."""
    _install(program(os.getpid()), 0)


def ask_about_paths() -> int:
    """From now on every call that names a path waits for an answer; the descriptor from which they are answered.

    Raises LayerMissing where the kernel cannot, or somebody further out answers for this process already.
    """
    try:
        return _install(asking(), _NEW_LISTENER | _ANSWERED_BEFORE_SIGNALS)
    except LayerMissing:
        return _install(asking(), _NEW_LISTENER)


def _install(code: bytes, flags: int) -> int:
    buffer = ctypes.create_string_buffer(code, len(code))
    header = struct.pack("=H6xQ", len(code) // 8, ctypes.addressof(buffer))
    result = _libc.syscall(_SYS_SECCOMP, 1, flags, header)
    if result < 0:
        raise LayerMissing(f"seccomp: {_last_error()}")
    return int(result)


#: Changes whenever what is allowed changes.
POLICY = hashlib.sha256(repr((sorted(_FILE_RIGHTS.items()), program(0), asking())).encode()).hexdigest()[:8]
