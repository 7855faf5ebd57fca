"""The system calls that student code may make (x86-64), and the seccomp filters that say so to the kernel.

What a path in one of them may be is not decided here: Landlock and the doorkeeper do.
"""

from __future__ import annotations

import errno
import signal
import struct
from collections.abc import Mapping
from dataclasses import dataclass

#: System calls that student code and its libraries need, and that can do nothing outside the process (x86-64).
#: What asks the kernel about more than the process is not among them: it would tell of trials before and beside it.
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

#: Calls that name paths: for each path the argument with the descriptor it may start from, if any, and its own.
PATHS: dict[int, tuple[tuple[int | None, int], ...]] = {
    **dict.fromkeys((2, 4, 6, 21, 87, 89), ((None, 0),)),  # open, stat, lstat, access, unlink, readlink
    82: ((None, 0), (None, 1)),  # rename
    # openat, newfstatat, unlinkat, readlinkat, faccessat, statx, faccessat2; renameat, renameat2
    **dict.fromkeys((257, 262, 263, 267, 269, 332, 439), ((0, 1),)),
    **dict.fromkeys((264, 316), ((0, 1), (2, 3))),
}
#: Of these, those that may make a file: the argument with their flags.
OPENS = {2: 1, 257: 2}

_LOAD, _JUMP_EQUAL, _JUMP_AT_LEAST, _JUMP_SET, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_AND = 0x54
_RET_KILL, _RET_ALLOW, _RET_ERRNO, _RET_ASK = 0x80000000, 0x7FFF0000, 0x00050000, 0x7FC00000
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
    """A call that is allowed when the low 32 bits of each argument named are among its values."""

    number: int
    values: Mapping[int, tuple[int, ...]]
    zero: int | None = None  # an argument that has to be zero in all 64 bits


def _rules(pid: int) -> tuple[Rule, ...]:
    """Calls that depend on an argument; everything not named is refused."""
    tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex = 0x5413, 0x5401, 0x541B, 0x5421, 0x5451, 0x5450
    rename_noreplace, rename_exchange = 1, 2  # but not RENAME_WHITEOUT, which leaves a device behind
    f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec = 0, 1, 2, 3, 4, 1030
    arch_get_fs, arch_set_fs = 0x1003, 0x1002
    dontneed, free, hugepage, nohugepage = 4, 8, 14, 15  # the own memory, and no other's pages
    # One's own death by SIGKILL would look like the machine's doing; queued signals are counted for a whole user.
    signals = tuple(number for number in range(32) if number != signal.SIGKILL)
    own = (0, pid)
    clocks = tuple(range(12))  # those without a process or a device in their number
    # Only at places of the own memory: others can wait at those of a file that they read too.
    futex_private, clock_realtime = 128, 256
    waits = tuple(range(futex_private, futex_private + 14))
    return (
        Rule(16, {1: (tiocgwinsz, tcgets, fionread, fionbio, fioclex, fionclex)}),
        Rule(28, {2: (dontneed, free, hugepage, nohugepage)}),  # madvise
        Rule(72, {1: (f_dupfd, f_getfd, f_setfd, f_getfl, f_setfl, f_dupfd_cloexec)}),
        Rule(62, {0: (pid,), 1: signals}),  # kill
        Rule(234, {0: (pid,), 2: signals}),  # tgkill
        Rule(157, {0: (15, 16)}),  # prctl: the name
        Rule(158, {0: (arch_get_fs, arch_set_fs)}),
        Rule(316, {4: (0, rename_noreplace, rename_exchange)}),  # renameat2: the flags
        Rule(302, {0: own}, zero=2),  # prlimit64: only reading; the argument is a pointer
        Rule(124, {0: own}),  # getsid
        Rule(140, {0: (0,), 1: own}),  # getpriority
        *(Rule(number, {0: own}) for number in (143, 145, 204, 274)),  # sched_get*, get_robust_list
        *(Rule(number, {0: clocks}) for number in (228, 229, 230)),  # clock_*
        Rule(202, {1: (*waits, *(clock_realtime | each for each in waits))}),  # futex
    )


def instructions(pid: int) -> list[Instruction]:
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
    return [*code, (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM)]


def asking() -> bytes:
    """A filter beside the other, whose refusals count for more: who names a path has to wait for an answer."""
    code: list[Instruction] = [(_LOAD, 0, 0, _AT_NUMBER)]
    for number in PATHS:
        code += _only_if(number, [(_RETURN, 0, 0, _RET_ASK)])
    return packed([*code, (_RETURN, 0, 0, _RET_ALLOW)])


def packed(code: list[Instruction]) -> bytes:
    """As the kernel takes them."""
    return b"".join(struct.pack("=HBBI", *instruction) for instruction in code)


def _only_if(number: int, body: list[Instruction]) -> list[Instruction]:
    """``body`` for that call alone; the number is loaded before and, as a body always returns, still is after."""
    return [(_JUMP_EQUAL, 0, len(body), number), *body]


def _equal_to(rule: Rule) -> list[Instruction]:
    refused = (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM)
    body: list[Instruction] = []
    if rule.zero is not None:
        for half in (0, 4):
            body += [(_LOAD, 0, 0, _argument(rule.zero) + half), (_JUMP_EQUAL, 1, 0, 0), refused]
    for argument, values in rule.values.items():
        body.append((_LOAD, 0, 0, _argument(argument)))
        body += [(_JUMP_EQUAL, left, 0, value) for left, value in zip(range(len(values), 0, -1), values, strict=True)]
        body.append(refused)
    return [*body, (_RETURN, 0, 0, _RET_ALLOW)]


def _never_set_uid(flags: int, mode: int) -> list[Instruction]:
    """No file without a name is created. Where none is created nobody sets the mode, and anything may stand there."""
    return [
        (_LOAD, 0, 0, _argument(flags)),
        (_JUMP_SET, 0, 1, _O_TMPFILE),
        (_RETURN, 0, 0, _RET_ERRNO | errno.EPERM),
        (_JUMP_SET, 0, 3, _O_CREAT),
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


#: More than any process has for its number.
_NOBODY = 0x7FFF_FFFF
_OF_NOBODY = packed(instructions(_NOBODY))


def program(pid: int) -> bytes:
    """``instructions``, packed: put together before any fork, but for the number."""
    return _OF_NOBODY.replace(_NOBODY.to_bytes(4, "little"), pid.to_bytes(4, "little"))
