"""The kernel's walls, put up by a process round itself: Landlock for files, a seccomp filter for everything else.

Both are needed: Landlock knows files but not the network, seccomp knows system calls but not files. There is no way
back, and neither needs a privilege.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import os
import struct
from dataclasses import dataclass

_libc = ctypes.CDLL(None, use_errno=True)

_PR_SET_NO_NEW_PRIVS = 38
_SYS_CAPGET, _SYS_CAPSET = 125, 126
_CAPABILITIES = struct.pack("=Ii", 0x20080522, 0)  # the third version of the interface, this process
_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID = 0, 1, 5, 6, 7
_SYS_SECCOMP = 317
_SYS_LANDLOCK_CREATE_RULESET = 444
_SYS_LANDLOCK_ADD_RULE = 445
_SYS_LANDLOCK_RESTRICT_SELF = 446

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
_REMOVE_FILE, _MAKE_REG, _TRUNCATE = 1 << 5, 1 << 8, 1 << 14
_FILE_ONLY = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE

#: All file rights that each version of Landlock's interface knows (linux/landlock.h).
_FILE_RIGHTS = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 4: (1 << 15) - 1, 5: (1 << 16) - 1}
_NETWORK_RIGHTS = 0b11  # bind and connect TCP, from version 4
_SCOPES = 0b11  # abstract sockets and signals, from version 6


class WallMissing(Exception):
    """A wall that cannot be put up here; the text names it and what the system said."""


@dataclass(frozen=True)
class Grants:
    """What stays reachable: files and folders to read, folders to list, and one flat folder to write in."""

    read: tuple[str, ...]
    list_only: tuple[str, ...] = ()
    write: int | None = None  # a descriptor of the folder
    open_to_others: bool = False  # whether a user who owns nothing could read them
    without: tuple[str, ...] = ()  # modules that student code does without


def landlock_version() -> int:
    """The version of Landlock's interface, 0 if the kernel has none or has it switched off."""
    version = _libc.syscall(_SYS_LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), ctypes.c_uint32(1))
    return max(int(version), 0)


def forbid_new_privileges() -> None:
    """No set-uid program can lift the walls."""
    if _libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0:
        raise WallMissing(f"no_new_privs: {_last_error()}")


def drop_capabilities() -> None:
    """Root keeps its name and loses its powers: no mounts, no raw sockets, no pages taken from the machine."""
    if _libc.syscall(_SYS_CAPSET, _CAPABILITIES, bytes(24)) != 0:
        raise WallMissing(f"capset: {_last_error()}")


def may_change_user() -> bool:
    """Whether this process can become somebody else, and its parent can still end it and tidy up after it."""
    sets = ctypes.create_string_buffer(24)
    if os.geteuid() != 0 or _libc.syscall(_SYS_CAPGET, _CAPABILITIES, sets) != 0:
        return False
    effective = struct.unpack_from("=I", sets)[0]
    return all(effective >> power & 1 for power in (_CHOWN, _DAC_OVERRIDE, _KILL, _SETGID, _SETUID))


def become(user: int) -> None:
    """Be ``user``, and in no group but its own. Raises WallMissing."""
    try:
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
    except OSError as error:
        raise WallMissing(f"own user: {error.strerror}") from None


def restrict_files(grants: Grants, most: int = 99) -> int:
    """Let this process reach nothing but ``grants``; at most version ``most`` is used. The version in force."""
    version = min(landlock_version(), most)
    if version < 1:
        raise WallMissing(
            "Landlock: the kernel does not have it or it is switched off (needs 5.13 with landlock in lsm=)"
        )
    rights = _FILE_RIGHTS[min(version, 5)]
    ruleset = _create_ruleset(rights, version)
    try:
        for path in grants.read:
            _allow_path(ruleset, path, (_READ_FILE | _READ_DIR) & rights)
        for path in grants.list_only:
            _allow_path(ruleset, path, _READ_DIR)
        if grants.write is not None:
            own = _READ_FILE | _READ_DIR | _WRITE_FILE | _MAKE_REG | _REMOVE_FILE | _TRUNCATE
            _add_rule(ruleset, grants.write, own & rights)
        if _libc.syscall(_SYS_LANDLOCK_RESTRICT_SELF, ruleset, 0) != 0:
            raise WallMissing(f"Landlock: {_last_error()}")
    finally:
        os.close(ruleset)
    return version


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
    raise WallMissing(f"Landlock: {_last_error()}")


def _allow_path(ruleset: int, path: str, rights: int) -> None:
    try:
        fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        return
    try:
        is_folder = os.path.isdir(path)
        _add_rule(ruleset, fd, rights if is_folder else rights & _FILE_ONLY)
    finally:
        os.close(fd)


def _add_rule(ruleset: int, fd: int, rights: int) -> None:
    rule = struct.pack("=Qi", rights, fd)
    if _libc.syscall(_SYS_LANDLOCK_ADD_RULE, ruleset, 1, rule, 0) != 0:
        raise WallMissing(f"Landlock: {_last_error()}")


def _last_error() -> str:
    return os.strerror(ctypes.get_errno())


#: System calls that student code and its libraries need, and that can do nothing outside the process (x86-64).
ALLOWED: dict[str, int] = {
    "read": 0,
    "write": 1,
    "close": 3,
    "fstat": 5,
    "poll": 7,
    "lseek": 8,
    "mmap": 9,
    "mprotect": 10,
    "munmap": 11,
    "brk": 12,
    "rt_sigaction": 13,
    "rt_sigprocmask": 14,
    "rt_sigreturn": 15,
    "pread64": 17,
    "pwrite64": 18,
    "readv": 19,
    "writev": 20,
    "access": 21,
    "pipe": 22,
    "select": 23,
    "sched_yield": 24,
    "mremap": 25,
    "msync": 26,
    "mincore": 27,
    "madvise": 28,
    "dup": 32,
    "dup2": 33,
    "pause": 34,
    "nanosleep": 35,
    "getitimer": 36,
    "alarm": 37,
    "setitimer": 38,
    "getpid": 39,
    "exit": 60,
    "uname": 63,
    "fsync": 74,
    "fdatasync": 75,
    "ftruncate": 77,
    "getdents": 78,
    "getcwd": 79,
    "stat": 4,
    "lstat": 6,
    "rename": 82,
    "unlink": 87,
    "readlink": 89,
    "umask": 95,
    "gettimeofday": 96,
    "getrlimit": 97,
    "getrusage": 98,
    "sysinfo": 99,
    "times": 100,
    "getuid": 102,
    "getgid": 104,
    "geteuid": 107,
    "getegid": 108,
    "getppid": 110,
    "getpgrp": 111,
    "getsid": 124,
    "rt_sigpending": 127,
    "rt_sigtimedwait": 128,
    "rt_sigsuspend": 130,
    "sigaltstack": 131,
    "getpriority": 140,
    "sched_getparam": 143,
    "sched_getscheduler": 145,
    "gettid": 186,
    "time": 201,
    "futex": 202,
    "sched_getaffinity": 204,
    "epoll_create": 213,
    "getdents64": 217,
    "set_tid_address": 218,
    "restart_syscall": 219,
    "fadvise64": 221,
    "clock_gettime": 228,
    "clock_getres": 229,
    "clock_nanosleep": 230,
    "exit_group": 231,
    "epoll_wait": 232,
    "epoll_ctl": 233,
    "newfstatat": 262,
    "unlinkat": 263,
    "renameat": 264,
    "readlinkat": 267,
    "faccessat": 269,
    "pselect6": 270,
    "ppoll": 271,
    "set_robust_list": 273,
    "get_robust_list": 274,
    "epoll_pwait": 281,
    "eventfd2": 290,
    "epoll_create1": 291,
    "dup3": 292,
    "pipe2": 293,
    "preadv": 295,
    "pwritev": 296,
    "getcpu": 309,
    "getrandom": 318,
    "membarrier": 324,
    "copy_file_range": 326,
    "statx": 332,
    "rseq": 334,
    "close_range": 436,
    "faccessat2": 439,
}

_LOAD, _JUMP_EQUAL, _JUMP_AT_LEAST, _JUMP_SET, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_AND = 0x54
_RET_KILL, _RET_ALLOW, _RET_ERRNO = 0x80000000, 0x7FFF0000, 0x00050000
_ARCH_X86_64 = 0xC000003E
_X32 = 0x40000000
_AT_NUMBER, _AT_ARCH = 0, 4
_OPEN, _OPENAT, _CLONE, _CLONE3 = 2, 257, 56, 435
_O_ACCMODE, _O_TRUNC, _O_CREAT, _O_TMPFILE = 0o3, 0o1000, 0o100, 0o20000000
_SPECIAL_MODES = 0o7000  # set-uid, set-gid, sticky


def _argument(index: int) -> int:
    """Where the low half of an argument lies in what the filter sees; the high half is four bytes on."""
    return 16 + 8 * index


Instruction = tuple[int, int, int, int]


@dataclass(frozen=True)
class Rule:
    """A call that is allowed when the low 32 bits of an argument, or all 64, are one of ``values``."""

    number: int
    argument: int
    values: tuple[int, ...]
    whole: bool = False


def _rules(pid: int) -> tuple[Rule, ...]:
    """Calls that depend on an argument; everything not named is refused."""
    tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex = 0x5413, 0x5401, 0x541B, 0x5421, 0x5451, 0x5450
    rename_noreplace, rename_exchange = 1, 2  # but not RENAME_WHITEOUT, which leaves a device behind
    f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec = 0, 1, 2, 3, 4, 1030
    arch_get_fs, arch_set_fs = 0x1003, 0x1002
    return (
        Rule(16, 1, (tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex)),
        Rule(72, 1, (f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec)),
        Rule(62, 0, (pid,)),  # kill
        Rule(234, 0, (pid,)),  # tgkill
        Rule(157, 0, (15, 16)),  # prctl: the name
        Rule(158, 0, (arch_get_fs, arch_set_fs)),
        Rule(316, 4, (0, rename_noreplace, rename_exchange)),  # renameat2: the flags
        Rule(302, 2, (0,), whole=True),  # prlimit64: only reading; the argument is a pointer
    )


def program(pid: int) -> bytes:
    """The filter for the process ``pid``: anything that is not allowed fails with EPERM, foreign ABIs kill."""
    code: list[Instruction] = [
        (_LOAD, 0, 0, _AT_ARCH),
        (_JUMP_EQUAL, 1, 0, _ARCH_X86_64),
        (_RETURN, 0, 0, _RET_KILL),
        (_LOAD, 0, 0, _AT_NUMBER),
        (_JUMP_AT_LEAST, 0, 1, _X32),
        (_RETURN, 0, 0, _RET_KILL),
    ]
    for number in ALLOWED.values():
        code += [(_JUMP_EQUAL, 0, 1, number), (_RETURN, 0, 0, _RET_ALLOW)]
    for rule in _rules(pid):
        code += _only_if(rule.number, _equal_to(rule))
    code += _only_if(_OPEN, _never_set_uid(1, 2) + _never_truncating(1))
    code += _only_if(_OPENAT, _never_set_uid(2, 3) + _never_truncating(2))
    code += _only_if(_CLONE3, [(_RETURN, 0, 0, _RET_ERRNO | errno.ENOSYS)])
    code += _only_if(_CLONE, [(_RETURN, 0, 0, _RET_ERRNO | errno.EAGAIN)])
    code.append((_RETURN, 0, 0, _RET_ERRNO | errno.EPERM))
    return b"".join(struct.pack("=HBBI", *instruction) for instruction in code)


def _only_if(number: int, body: list[Instruction]) -> list[Instruction]:
    """``body`` for that call alone; the number is loaded before and, as a body always returns, still is after."""
    return [(_JUMP_EQUAL, 0, len(body), number), *body]


def _equal_to(rule: Rule) -> list[Instruction]:
    refused = (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM)
    body: list[Instruction] = []
    if rule.whole:
        body += [(_LOAD, 0, 0, _argument(rule.argument) + 4), (_JUMP_EQUAL, 1, 0, 0), refused]
    body.append((_LOAD, 0, 0, _argument(rule.argument)))
    for value in rule.values:
        body += [(_JUMP_EQUAL, 0, 1, value), (_RETURN, 0, 0, _RET_ALLOW)]
    return [*body, refused]


def _never_set_uid(flags: int, mode: int) -> list[Instruction]:
    """Where no file is created nobody sets the mode, and anything may stand there."""
    return [
        (_LOAD, 0, 0, _argument(flags)),
        (_JUMP_SET, 0, 3, _O_CREAT | _O_TMPFILE),
        (_LOAD, 0, 0, _argument(mode)),
        (_JUMP_SET, 0, 1, _SPECIAL_MODES),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
    ]


def _never_truncating(argument: int) -> list[Instruction]:
    """Opening for reading, or for neither, with O_TRUNC empties a file where Landlock does not know truncation.

    For neither (both bits set) Landlock asks for no right at all, so that is refused altogether.
    """
    return [
        (_LOAD, 0, 0, _argument(argument)),
        (_AND, 0, 0, _O_ACCMODE),
        (_JUMP_EQUAL, 0, 1, _O_ACCMODE),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_LOAD, 0, 0, _argument(argument)),
        (_JUMP_SET, 0, 3, _O_TRUNC),
        (_AND, 0, 0, _O_ACCMODE),
        (_JUMP_EQUAL, 0, 1, 0),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_RETURN, 0, 0, _RET_ALLOW),
    ]


def restrict_system_calls() -> None:
    """Install the filter on this process, for ever."""
    code = program(os.getpid())
    buffer = ctypes.create_string_buffer(code, len(code))
    header = struct.pack("=H6xQ", len(code) // 8, ctypes.addressof(buffer))
    if _libc.syscall(_SYS_SECCOMP, 1, 0, header) != 0:
        raise WallMissing(f"seccomp: {_last_error()}")


#: Changes whenever what is allowed changes.
POLICY = hashlib.sha256(repr((sorted(_FILE_RIGHTS.items()), program(0))).encode()).hexdigest()[:8]
