"""Kernel layers that a process applies to itself: Landlock for files, and a seccomp filter for all system calls.

Both are needed: Landlock restricts files but not the network, seccomp restricts system calls but not files. They can't
be undone and need no privileges. ``system_calls.py`` lists the allowed calls.
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

from .system_calls import build_path_filter, pack_filter

_libc = ctypes.CDLL(None, use_errno=True)

_PR_SET_NO_NEW_PRIVS = 38
_PERSONALITY_AS_IT_IS, _ADDR_NO_RANDOMIZE = 0xFFFFFFFF, 0x40000
_SYS_CAPGET, _SYS_CAPSET = 125, 126
_CAPABILITIES = struct.pack("=Ii", 0x20080522, 0)  # version 3 of the interface, this process
_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID = 0, 1, 5, 6, 7
_SYS_SECCOMP = 317
_NEW_LISTENER, _ANSWERED_BEFORE_SIGNALS = 8, 32  # the second from Linux 5.19
_SYS_LANDLOCK_CREATE_RULESET = 444
_SYS_LANDLOCK_ADD_RULE = 445
_SYS_LANDLOCK_RESTRICT_SELF = 446

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_REMOVE_FILE, _MAKE_REG, _TRUNCATE = 1 << 5, 1 << 8, 1 << 14
_FILE_ONLY = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE

#: All file rights in each version of Landlock's interface (linux/landlock.h).
_FILE_RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 4: (1 << 15) - 1, 5: (1 << 16) - 1}
_RULE = struct.Struct("=Qi")  # rights, and the descriptor that they apply to
#: Lowest descriptor number for ``build_reading_rules``.
LOWEST_DESCRIPTOR = 256
_NETWORK_RIGHTS = 0b11  # bind and connect TCP, from version 4
_SCOPES = 0b11  # abstract sockets and signals, from version 6


class LayerMissing(Exception):
    """Raised when a layer is not available here. The message has its name and the system's error."""


@dataclass(frozen=True)
class Grants:
    """The paths that stay accessible: to read, and only to list."""

    read: tuple[str, ...]
    list_only: tuple[str, ...] = ()
    open_to_others: bool = False  # whether an unprivileged user could read them
    excluded_modules: tuple[str, ...] = ()  # modules excluded by the assignment


def read_landlock_version() -> int:
    """Return the version of Landlock's interface, or 0 if it is missing or disabled."""
    version = _libc.syscall(_SYS_LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(1))
    return max(int(version), 0)


def set_process_option(option: int, value: int) -> None:
    """Set an option of the process, see prctl(2)."""
    _libc.prctl(option, value, 0, 0, 0)


def pin_to_processors(processors: bytes) -> None:
    """Restrict this process to some processors, given as a bit mask, see sched_setaffinity(2)."""
    _libc.sched_setaffinity(0, ctypes.c_size_t(len(processors)), processors)


def has_fixed_addresses() -> bool:
    """Return whether this process has memory addresses that are equal in identical processes."""
    personality = _libc.personality(ctypes.c_ulong(_PERSONALITY_AS_IT_IS))
    return personality >= 0 and bool(personality & _ADDR_NO_RANDOMIZE)


def forbid_new_privileges() -> None:
    """Prevent set-uid programs from gaining privileges."""
    if _libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise LayerMissing(f"no_new_privs: {_describe_last_error()}")


def drop_capabilities() -> None:
    """Drop all capabilities. Root then can't mount, use raw sockets or reserve memory of the machine."""
    if _libc.syscall(_SYS_CAPSET, _CAPABILITIES, bytes(24)) != 0:
        raise LayerMissing(f"capset: {_describe_last_error()}")


def can_change_user() -> bool:
    """Return whether this process can change its user while its parent can still kill it and delete its files."""
    sets = ctypes.create_string_buffer(24)
    if os.geteuid() != 0 or _libc.syscall(_SYS_CAPGET, _CAPABILITIES, sets) != 0:
        return False
    effective_set = struct.unpack_from("=I", sets)[0]
    return all(effective_set >> power & 1 for power in (_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID))


def switch_user(user: int) -> None:
    """Switch to ``user``, with only its own group.

    Raises:
        LayerMissing: If the system refuses.
    """
    try:
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
    except OSError as error:
        raise LayerMissing(f"own user: {error.strerror}") from None


def build_reading_rules(grants: Grants) -> tuple[bytes, ...]:
    """Return the Landlock rules for ``grants``. The files stay open, so that forks need not look them up again."""
    rights = {**dict.fromkeys(grants.read, _READ_FILE | _READ_DIR), **dict.fromkeys(grants.list_only, _READ_DIR)}
    return tuple(rule for path, allowed in rights.items() for rule in _build_rules(path, allowed))


def _build_rules(path: str, rights: int) -> Iterator[bytes]:
    with contextlib.suppress(FileNotFoundError):
        fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
        yield _RULE.pack(rights if os.path.isdir(path) else rights & _FILE_ONLY, _move_descriptor(fd))


def _move_descriptor(fd: int) -> int:
    """Return a duplicate of the descriptor, above the numbers that a child uses."""
    try:
        return fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, LOWEST_DESCRIPTOR)
    finally:
        os.close(fd)


def build_writing_rule(folder: int, limit: int = 99) -> bytes:
    """Return the rule that allows writing in a flat folder, for Landlock up to version ``limit``."""
    rights = _READ_FILE | _READ_DIR | _WRITE_FILE | _MAKE_REG | _REMOVE_FILE | _TRUNCATE
    return _RULE.pack(rights & _look_up_file_rights(min(read_landlock_version(), limit)), folder)


def restrict_files(rules: Iterable[bytes], limit: int = 99) -> int:
    """Restrict this process to the files that ``rules`` allow. Return the Landlock version in use, up to ``limit``."""
    version = min(read_landlock_version(), limit)
    if version < 1:
        raise LayerMissing(
            "Landlock: the kernel does not have it or it is switched off (needs 5.13 with landlock in lsm=)"
        )
    ruleset = _create_ruleset(_look_up_file_rights(version), version)
    try:
        for rule in rules:
            if _libc.syscall(_SYS_LANDLOCK_ADD_RULE, ruleset, 1, rule, 0) != 0:
                raise LayerMissing(f"Landlock: {_describe_last_error()}")
        if _libc.syscall(_SYS_LANDLOCK_RESTRICT_SELF, ruleset, 0) != 0:
            raise LayerMissing(f"Landlock: {_describe_last_error()}")
    finally:
        os.close(ruleset)
    return version


def _look_up_file_rights(version: int) -> int:
    return _FILE_RIGHTS.get(min(version, 5), 0)


def _create_ruleset(rights: int, version: int) -> int:
    sizes = {1: 8, 2: 8, 3: 8, 4: 16, 5: 16}
    attribute = struct.pack("=QQQ", rights, _NETWORK_RIGHTS, _SCOPES)
    attribute_sizes = [sizes.get(version, 24), 16, 8] if version >= 4 else [8]
    for size in attribute_sizes:
        # Some kernels report a version but lack its scopes. Then the scopes are left out.
        ruleset = _libc.syscall(_SYS_LANDLOCK_CREATE_RULESET, attribute[:size], ctypes.c_size_t(size), 0)
        if ruleset >= 0:
            return int(ruleset)
        if ctypes.get_errno() != errno.EINVAL:
            break
    raise LayerMissing(f"Landlock: {_describe_last_error()}")


def _describe_last_error() -> str:
    return os.strerror(ctypes.get_errno())


def restrict_system_calls() -> None:
    """Install the seccomp filter on this process permanently."""
    _install_filter(pack_filter(os.getpid()), 0)


def install_path_filter() -> int:
    """Suspend every system call with a path until a decision. Return the descriptor for the decisions.

    Raises:
        LayerMissing: If the kernel doesn't support it, or an outer process already decides for this one.
    """
    try:
        return _install_filter(build_path_filter(), _NEW_LISTENER | _ANSWERED_BEFORE_SIGNALS)
    except LayerMissing:
        return _install_filter(build_path_filter(), _NEW_LISTENER)


def _install_filter(code: bytes, flags: int) -> int:
    buffer = ctypes.create_string_buffer(code, len(code))
    header = struct.pack("=H6xQ", len(code) // 8, ctypes.addressof(buffer))
    result = _libc.syscall(_SYS_SECCOMP, 1, flags, header)
    if result < 0:
        raise LayerMissing(f"seccomp: {_describe_last_error()}")
    return int(result)


#: Version of the policy, a hash of what is allowed.
POLICY = hashlib.sha256(repr((sorted(_FILE_RIGHTS.items()), pack_filter(0), build_path_filter())).encode()).hexdigest()[
    :8
]
