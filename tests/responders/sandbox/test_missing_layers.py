"""A machine without a layer of the sandbox refuses student code, with a message that names the missing layer.

A filter simulates such machines: it refuses calls as an old kernel, a disabled module or a container does.
"""

from __future__ import annotations

import errno
import subprocess
import sys
from pathlib import Path

import pytest

#: Refuses one system call with one error, for itself and all its children, then runs the rest.
_BEHIND = """
import ctypes, struct, sys
number, error = int(sys.argv[1]), int(sys.argv[2])
code = [(0x20, 0, 0, 0), (0x15, 0, 1, number), (6, 0, 0, 0x50000 | error), (6, 0, 0, 0x7FFF0000)]
filter = b"".join(struct.pack("=HBBI", *each) for each in code)
buffer = ctypes.create_string_buffer(filter, len(filter))
libc = ctypes.CDLL(None, use_errno=True)
libc.prctl(38, 1, 0, 0, 0)
assert libc.syscall(317, 1, 0, struct.pack("=H6xQ", len(code), ctypes.addressof(buffer))) == 0
"""
_CHECK = """
from responders.sandbox.manager import Sandboxes
from sim.errors import HostError
try:
    with Sandboxes() as sandboxes:
        print("stands:", sandboxes.check_isolation())
except HostError as error:
    print(f"{type(error).__name__}: {error}")
    sys.exit(3)
"""
_GRADE = """
from service.cli import main
sys.argv = ["robomark", "run", sys.argv[3]]
main()
"""

_CREATE, _ADD, _RESTRICT, _SECCOMP, _PIDFD_OPEN, _PIDFD_SIGNAL, _CAPSET, _UNUSED, _PERSONALITY = (
    444,
    445,
    446,
    317,
    434,
    424,
    126,
    176,
    135,
)


@pytest.mark.parametrize(
    ("number", "error", "words"),
    [
        pytest.param(_CREATE, errno.ENOSYS, "Landlock", id="landlock-too-old"),
        pytest.param(_CREATE, errno.EOPNOTSUPP, "Landlock", id="landlock-off", marks=pytest.mark.long),
        pytest.param(_CREATE, errno.EPERM, "Landlock", id="landlock-denied", marks=pytest.mark.long),
        pytest.param(_ADD, errno.EPERM, "Landlock", id="landlock-rules-denied", marks=pytest.mark.long),
        pytest.param(_RESTRICT, errno.EPERM, "Landlock", id="landlock-restriction-denied"),
        pytest.param(_SECCOMP, errno.ENOSYS, "seccomp", id="seccomp-too-old", marks=pytest.mark.long),
        pytest.param(_SECCOMP, errno.EPERM, "seccomp", id="seccomp-denied"),
        pytest.param(_SECCOMP, errno.EINVAL, "seccomp", id="seccomp-without-filters", marks=pytest.mark.long),
        pytest.param(_PIDFD_OPEN, errno.ENOSYS, "pidfd_open", id="pidfd-too-old"),
        pytest.param(_PIDFD_OPEN, errno.EPERM, "pidfd_open", id="pidfd-denied", marks=pytest.mark.long),
        pytest.param(_PIDFD_SIGNAL, errno.EPERM, "pidfd_send_signal", id="signals-denied"),
        pytest.param(_CAPSET, errno.EPERM, "capset", id="capabilities-denied"),
    ],
)
def test_a_missing_layer_is_named(number: int, error: int, words: str) -> None:
    ran = _run(_CHECK, number, error)
    assert ran.returncode == 3
    assert ran.stdout.startswith(f"SandboxMissing: this machine cannot enclose student code: {words}:"), ran.stdout
    assert "Linux 5.13" in ran.stdout
    assert "Traceback" not in ran.stderr


def test_behind_a_filter_that_denies_nothing_they_stand() -> None:
    ran = _run(_CHECK, _UNUSED, errno.EPERM)
    assert ran.returncode == 0
    assert "seccomp" in ran.stdout


def test_where_addresses_cannot_be_fixed_they_stand_without() -> None:
    ran = _run(_CHECK, _PERSONALITY, errno.EPERM)
    assert ran.returncode == 0
    assert "seccomp" in ran.stdout
    assert "fixed addresses" not in ran.stdout


@pytest.mark.parametrize(
    ("number", "word"),
    [
        (_CREATE, "Landlock"),
        pytest.param(_SECCOMP, "seccomp", marks=pytest.mark.long),
        pytest.param(_PIDFD_OPEN, "pidfd_open", marks=pytest.mark.long),
    ],
)
def test_the_command_line_refuses(number: int, word: str, tmp_path: Path) -> None:
    program = tmp_path / "robot.py"
    program.write_text("print('it ran')\n")
    ran = _run(_GRADE, number, errno.ENOSYS, str(program))
    assert ran.returncode == 3
    assert word in ran.stderr + ran.stdout
    assert "it ran" not in ran.stdout
    assert "Traceback" not in ran.stderr


def _run(rest: str, number: int, error: int, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", _BEHIND + rest, str(number), str(error), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )
