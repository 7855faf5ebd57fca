"""The system call filter, run by an interpreter of its instructions: its decision on every system call."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import pytest

from filter_machine import AARCH64, I386, X86_64, decide, listed
from responders.sandbox.inside.system_calls import (
    ALLOWED,
    PATH_ARGUMENTS,
    build_filter,
    build_path_filter,
    pack_filter,
    pack_instructions,
)

PID = 54321
FILTER = pack_filter(PID)
#: Signals that only other processes send, and no queued ones.
SIGNALS = set(range(32)) - {9}
X32 = 1 << 30
HIGH = 1 << 32
CALLS = {number: (name, decision) for number, name, decision in listed()}

#: Calls with a rule for an argument: when they are allowed. Only the bits that the kernel reads count, mostly 32.
SOME: dict[str, Callable[[Sequence[int]], bool]] = {
    "open": lambda a: _opens(a[1], a[2]),
    "openat": lambda a: _opens(a[2], a[3]),
    "ioctl": lambda a: _low(a[1]) in (0x5401, 0x5413, 0x541B, 0x5421, 0x5450, 0x5451),
    "fcntl": lambda a: _low(a[1]) in (0, 1, 2, 3, 4, 1030),
    "kill": lambda a: _low(a[0]) == PID and _low(a[1]) in SIGNALS,
    "tgkill": lambda a: _low(a[0]) == PID and _low(a[2]) in SIGNALS,
    "prctl": lambda a: _low(a[0]) in (15, 16),
    "arch_prctl": lambda a: _low(a[0]) in (0x1002, 0x1003),
    "renameat2": lambda a: _low(a[4]) in (0, 1, 2),
    "prlimit64": lambda a: _own(a[0]) and a[2] == 0,
    "getsid": lambda a: _own(a[0]),
    "getpriority": lambda a: _low(a[0]) == 0 and _own(a[1]),
    "sched_getparam": lambda a: _own(a[0]),
    "sched_getscheduler": lambda a: _own(a[0]),
    "sched_getaffinity": lambda a: _own(a[0]),
    "get_robust_list": lambda a: _own(a[0]),
    "clock_gettime": lambda a: _low(a[0]) < 12,
    "clock_getres": lambda a: _low(a[0]) < 12,
    "clock_nanosleep": lambda a: _low(a[0]) < 12,
    "futex": lambda a: _low(a[1]) & ~256 in range(128, 142),
    "madvise": lambda a: _low(a[2]) in (4, 8, 14, 15),
}
#: Each value is tried in each argument: processes, flags, requests and pointers, and their lower 32 bits.
EDGES = (
    *(0, 1, 2, 3, 4, 5, 8, 10, 15, 16, 1030, 1031, PID, PID - 1, PID + 1, -1, -PID, 1 << 31, HIGH, (1 << 64) - 1),
    *(0o1000, 0o1001, 0o1002, 0o1003, 0o101, 0o1101, 0o100000, 0o20200000, 0x5401, 0x5412, 0x5413, 0x541B, 0x541C),
    *(9, 11, 12, 14, 19, 21, 31, 32, 40, 127, 128, 141, 142, 393, 397, 398, (~PID << 3) | 2, -6),
    *(0o4755, 0o2755, 0x5421, 0x5450, 0x5451, 0x8901, 0x1001, 0x1002, 0x1003, 0x1004, 0x7FFFFFFFF000),
)


def _low(value: int) -> int:
    return value & 0xFFFFFFFF


def _own(pid: int) -> bool:
    return _low(pid) in (0, PID)


def _opens(flags: int, mode: int) -> bool:
    access = flags & 3
    special = flags & 0o100 and mode & 0o7000
    without_a_name = flags & 0o20000000
    return not special and not without_a_name and (access in (1, 2) or (access == 0 and not flags & 0o1000))


def _arguments(everything: bool) -> list[list[int]]:
    """Return each edge value in each argument, plain and with its high half set; or only a few of them."""
    if not everything:
        return [[value] * 6 for value in (0, 1, PID, HIGH, (1 << 64) - 1)]
    values = {edge & (1 << 64) - 1 for plain in EDGES for edge in (plain, plain | HIGH)}
    argument_lists = []
    for place, value in itertools.product(range(6), sorted(values)):
        for fill in (0, 0o102, PID, (1 << 64) - 1):
            arguments = [fill] * 6
            arguments[place] = value
            argument_lists.append(arguments)
    return argument_lists


@pytest.mark.long
@pytest.mark.parametrize("number", range(601))
def test_each_call_is_decided_as_listed(number: int) -> None:
    name, decision = CALLS.get(number, (str(number), "EPERM"))
    depends = decision == "some"
    assert depends == (name in SOME)
    for arguments in _arguments(everything=depends):
        expected = decision if not depends else "allow" if SOME[name](arguments) else "EPERM"
        assert decide(FILTER, number, arguments) == expected, (name, [hex(each) for each in arguments])


@pytest.mark.parametrize("architecture", [I386, AARCH64, 0, X86_64 & ~HIGH & 0x7FFFFFFF])
def test_a_foreign_architecture_is_the_end(architecture: int) -> None:
    assert {decide(FILTER, number, (0,) * 6, architecture) for number in range(601)} == {"kill"}


def test_x32_and_numbers_out_of_range_are_the_end() -> None:
    assert {decide(FILTER, X32 + number) for number in range(601)} == {"kill"}
    assert {decide(FILTER, number) for number in (-1, X32, 1 << 31, 0xFFFFFFFF)} == {"kill"}
    assert decide(FILTER, X32 - 1) == "EPERM"


def test_the_names_beside_the_numbers_are_right() -> None:
    """Reviewers read the names of the allow-list and rely on them."""
    assert {name: number for number, (name, decision) in CALLS.items() if decision == "allow"} == ALLOWED


def test_nothing_that_reaches_others_is_allowed() -> None:
    """A second check that does not derive from the allow-list."""
    words = [
        "sock",
        "send",
        "recv",
        "connect",
        "bind",
        "listen",
        "accept",
        "exec",
        "fork",
        "ptrace",
        "vm_",
        "pidfd",
        "mount",
        "ns",
        "uring",
        "bpf",
        "key",
        "memfd",
        "shm",
        "sem",
        "msg",
        "mq_",
        "chmod",
        "chown",
        "chroot",
        "setuid",
        "setgid",
        "cap",
        "landlock",
        "seccomp",
        "handle",
        "inotify",
        "fanotify",
        "module",
        "xattr",
    ]
    allowed_names = {name for name in ALLOWED if any(word in name for word in words)}
    assert not allowed_names


def test_whoever_names_a_path_has_to_ask() -> None:
    """Every allowed call that takes a path is passed to the doorkeeper."""
    words = (
        "open",
        "stat",
        "access",
        "link",
        "rename",
        "dir",
        "node",
        "mount",
        "trunc",
        "utime",
        "swap",
        "acct",
        "root",
    )
    naming = {
        name
        for name, decision in CALLS.values()
        if decision in ("allow", "some") and any(word in name for word in words)
    }
    checked_calls = {CALLS[number][0] for number in range(601) if decide(build_path_filter(), number) == "ask"}
    assert checked_calls == naming - {"fstat", "ftruncate"} == {CALLS[number][0] for number in PATH_ARGUMENTS}
    assert {decide(build_path_filter(), number) for number in range(601) if number not in PATH_ARGUMENTS} == {"allow"}


@pytest.mark.parametrize("pid", [1, 255, 256, 65_535, PID, 4_194_304])
def test_a_filter_that_was_made_ready_is_that_of_its_process(pid: int) -> None:
    assert pack_filter(pid) == pack_instructions(build_filter(pid))
