"""The system calls that student code may make (x86-64), and the seccomp filters that enforce them.

Landlock and the doorkeeper decide which paths may be used.
"""

from __future__ import annotations

import errno
import signal
import struct
from collections.abc import Mapping
from dataclasses import dataclass

#: System calls that student code and its libraries need and that have no effect outside the process (x86-64). Queries
#: about the rest of the system are excluded, because they would reveal other trials.
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
    "select": 23,
    "sched_yield": 24,
    "mremap": 25,
    "msync": 26,
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
    "times": 100,
    "getuid": 102,
    "getgid": 104,
    "geteuid": 107,
    "getegid": 108,
    "getppid": 110,
    "getpgrp": 111,
    "rt_sigpending": 127,
    "rt_sigsuspend": 130,
    "sigaltstack": 131,
    "gettid": 186,
    "time": 201,
    "getdents64": 217,
    "set_tid_address": 218,
    "restart_syscall": 219,
    "exit_group": 231,
    "newfstatat": 262,
    "unlinkat": 263,
    "renameat": 264,
    "readlinkat": 267,
    "faccessat": 269,
    "pselect6": 270,
    "ppoll": 271,
    "set_robust_list": 273,
    "dup3": 292,
    "preadv": 295,
    "pwritev": 296,
    "statx": 332,
    "rseq": 334,
    "close_range": 436,
    "faccessat2": 439,
}

#: Calls with paths. For each path: the argument with its start descriptor, if any, and the argument with the path.
PATH_ARGUMENTS: dict[int, tuple[tuple[int | None, int], ...]] = {
    **dict.fromkeys((2, 4, 6, 21, 87, 89), ((None, 0),)),  # open, stat, lstat, access, unlink, readlink
    82: ((None, 0), (None, 1)),  # rename
    # openat, newfstatat, unlinkat, readlinkat, faccessat, statx, faccessat2; renameat, renameat2
    **dict.fromkeys((257, 262, 263, 267, 269, 332, 439), ((0, 1),)),
    **dict.fromkeys((264, 316), ((0, 1), (2, 3))),
}
#: Those that may create a file, and the argument with their flags.
FLAG_ARGUMENTS = {2: 1, 257: 2}

_LOAD, _JUMP_EQUAL, _JUMP_AT_LEAST, _JUMP_SET, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_AND = 0x54
_RET_KILL, _RET_ALLOW, _RET_ERRNO, _RET_ASK = 0x80000000, 0x7FFF0000, 0x00050000, 0x7FC00000
_ARCH_X86_64 = 0xC000003E
_X32 = 0x40000000
_AT_NUMBER, _AT_ARCH = 0, 4
_OPEN, _OPENAT, _CLONE, _CLONE3 = 2, 257, 56, 435
_O_ACCMODE, _O_TRUNC, _O_CREAT, _O_TMPFILE = 0o3, 0o1000, 0o100, 0o20000000
_SPECIAL_MODES = 0o7000  # set-uid, set-gid, sticky


def _compute_argument_offset(index: int) -> int:
    """Return the offset of an argument's low half in the filter's data; the high half follows."""
    return 16 + 8 * index


Instruction = tuple[int, int, int, int]


@dataclass(frozen=True)
class ArgumentRule:
    """A call that is allowed if the low 32 bits of each listed argument are among its values."""

    number: int
    values: Mapping[int, tuple[int, ...]]
    zero: int | None = None  # an argument that must be zero in all 64 bits


def _build_argument_rules(pid: int) -> tuple[ArgumentRule, ...]:
    """Return the calls that depend on an argument. All others are refused."""
    tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex = 0x5413, 0x5401, 0x541B, 0x5421, 0x5451, 0x5450
    rename_noreplace, rename_exchange = 1, 2  # not RENAME_WHITEOUT, which creates a device
    f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec = 0, 1, 2, 3, 4, 1030
    arch_get_fs, arch_set_fs = 0x1003, 0x1002
    dontneed, free, hugepage, nohugepage = 4, 8, 14, 15  # only for the process's own memory
    # A SIGKILL to itself would look like a host fault; queued signals are counted per user.
    signals = tuple(number for number in range(32) if number != signal.SIGKILL)
    own_ids = (0, pid)
    clocks = tuple(range(12))  # without clocks of processes or devices
    # Only addresses in private memory: other processes can wait at those of a shared file.
    futex_private, clock_realtime = 128, 256
    waits = tuple(range(futex_private, futex_private + 14))
    return (
        ArgumentRule(16, {1: (tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex)}),
        ArgumentRule(28, {2: (dontneed, free, hugepage, nohugepage)}),  # madvise
        ArgumentRule(72, {1: (f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec)}),
        ArgumentRule(62, {0: (pid,), 1: signals}),  # kill
        ArgumentRule(234, {0: (pid,), 2: signals}),  # tgkill
        ArgumentRule(157, {0: (15, 16)}),  # prctl: the name
        ArgumentRule(158, {0: (arch_get_fs, arch_set_fs)}),
        ArgumentRule(316, {4: (0, rename_noreplace, rename_exchange)}),  # renameat2: the flags
        ArgumentRule(302, {0: own_ids}, zero=2),  # prlimit64: only reading; the argument is a pointer
        ArgumentRule(124, {0: own_ids}),  # getsid
        ArgumentRule(140, {0: (0,), 1: own_ids}),  # getpriority
        *(ArgumentRule(number, {0: own_ids}) for number in (143, 145, 204, 274)),  # sched_get*, get_robust_list
        *(ArgumentRule(number, {0: clocks}) for number in (228, 229, 230)),  # clock_*
        ArgumentRule(202, {1: (*waits, *(clock_realtime | each for each in waits))}),  # futex
    )


def build_filter(pid: int) -> list[Instruction]:
    """Return the filter for the process ``pid``: calls that are not allowed fail with EPERM, foreign ABIs kill."""
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
    for rule in _build_argument_rules(pid):
        code += _restrict_to_call(rule.number, _check_arguments(rule))
    code += _restrict_to_call(_OPEN, _refuse_special_modes(1, 2) + _refuse_truncation(1))
    code += _restrict_to_call(_OPENAT, _refuse_special_modes(2, 3) + _refuse_truncation(2))
    code += _restrict_to_call(_CLONE3, [(_RETURN, 0, 0, _RET_ERRNO | errno.ENOSYS)])
    code += _restrict_to_call(_CLONE, [(_RETURN, 0, 0, _RET_ERRNO | errno.EAGAIN)])
    return [*code, (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM)]


def build_path_filter() -> bytes:
    """Return the filter that makes calls with paths wait for a decision. A refusal of the other filter overrides it."""
    code: list[Instruction] = [(_LOAD, 0, 0, _AT_NUMBER)]
    for number in PATH_ARGUMENTS:
        code += _restrict_to_call(number, [(_RETURN, 0, 0, _RET_ASK)])
    return pack_instructions([*code, (_RETURN, 0, 0, _RET_ALLOW)])


def pack_instructions(code: list[Instruction]) -> bytes:
    """Return the instructions in the kernel's binary format."""
    return b"".join(struct.pack("=HBBI", *instruction) for instruction in code)


def _restrict_to_call(number: int, body: list[Instruction]) -> list[Instruction]:
    """Return ``body`` for one call only. The call number is loaded before, and after because a body always returns."""
    return [(_JUMP_EQUAL, 0, len(body), number), *body]


def _check_arguments(rule: ArgumentRule) -> list[Instruction]:
    refusal = (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM)
    body: list[Instruction] = []
    if rule.zero is not None:
        for half in (0, 4):
            body += [(_LOAD, 0, 0, _compute_argument_offset(rule.zero) + half), (_JUMP_EQUAL, 1, 0, 0), refusal]
    for argument, values in rule.values.items():
        body.append((_LOAD, 0, 0, _compute_argument_offset(argument)))
        body += [(_JUMP_EQUAL, left, 0, value) for left, value in zip(range(len(values), 0, -1), values, strict=True)]
        body.append(refusal)
    return [*body, (_RETURN, 0, 0, _RET_ALLOW)]


def _refuse_special_modes(flags: int, mode: int) -> list[Instruction]:
    """Return instructions that refuse O_TMPFILE, and special mode bits when a file is created.

    Without O_CREAT, the mode argument is unused and may have any value.
    """
    return [
        (_LOAD, 0, 0, _compute_argument_offset(flags)),
        (_JUMP_SET, 0, 1, _O_TMPFILE),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_JUMP_SET, 0, 3, _O_CREAT),
        (_LOAD, 0, 0, _compute_argument_offset(mode)),
        (_JUMP_SET, 0, 1, _SPECIAL_MODES),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
    ]


def _refuse_truncation(argument: int) -> list[Instruction]:
    """Return instructions that refuse O_TRUNC without write access, which empties a file on old Landlock versions.

    The access mode with both bits set is always refused, because Landlock asks for no right then.
    """
    return [
        (_LOAD, 0, 0, _compute_argument_offset(argument)),
        (_AND, 0, 0, _O_ACCMODE),
        (_JUMP_EQUAL, 0, 1, _O_ACCMODE),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_LOAD, 0, 0, _compute_argument_offset(argument)),
        (_JUMP_SET, 0, 3, _O_TRUNC),
        (_AND, 0, 0, _O_ACCMODE),
        (_JUMP_EQUAL, 0, 1, 0),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_RETURN, 0, 0, _RET_ALLOW),
    ]


#: Larger than any process id.
_PLACEHOLDER_PID = 0x7FFF_FFFF
_FILTER_TEMPLATE = pack_instructions(build_filter(_PLACEHOLDER_PID))


def pack_filter(pid: int) -> bytes:
    """Return the packed filter for this process id. Everything else is computed before any fork."""
    return _FILTER_TEMPLATE.replace(_PLACEHOLDER_PID.to_bytes(4, "little"), pid.to_bytes(4, "little"))
