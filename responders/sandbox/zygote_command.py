"""The command and environment of a zygote, identical for all zygotes so that their children behave identically.

They fix hash seeds, the order of sets, numeric kernels and, where the machine allows it, addresses.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from responders.sandbox.processor import ALLOWED
from sim.processes import build_arithmetic_environment, build_python_command

#: Start of a command with fixed memory addresses, because objects are hashed by address. The setting is inherited, so
#: it is made in a separate process, not in the worker. An exec that restores root's capabilities resets it;
#: bubblewrap's root process keeps the right to give them up (SECBIT_NOROOT) only for this.
_FIXED_ADDRESS_COMMAND = (
    sys.executable,
    *("-I", "-S", "-c"),
    "import ctypes, os, sys; libc = ctypes.CDLL(None); PR_SET_SECUREBITS, NOROOT_LOCKED, PR_CAP_AMBIENT, IS_SET, "
    "LOWER, CAP_SETPCAP = 28, 3, 47, 1, 3, 8; in_bubblewrap = libc.prctl(PR_CAP_AMBIENT, IS_SET, CAP_SETPCAP, 0, 0) "
    "== 1; in_bubblewrap and libc.prctl(PR_SET_SECUREBITS, NOROOT_LOCKED, 0, 0, 0); in_bubblewrap and "
    "libc.prctl(PR_CAP_AMBIENT, LOWER, CAP_SETPCAP, 0, 0); libc.personality(0x40000); os.execv(sys.argv[1], "
    "sys.argv[1:])",
)
_START_CODE = (
    f"import os, sys; os.sched_setaffinity(0, {sorted(ALLOWED)}); "
    "high = [os.dup2(int(fd), 100 + place) for place, fd in enumerate(sys.argv[1:3])]; "
    "os.dup2(high[0], 3); os.dup2(high[1], 4); os.closerange(5, 1 << 16); sys.path.insert(0, sys.argv[3]); "
    "from inside.zygote import main; main(sys.argv[4], sys.argv[5], sys.argv[6].split(), sys.argv[7:])"
)


def build_command(sockets: Sequence[int], arguments: Sequence[str]) -> list[str]:
    """Return the command of a zygote with these two socket descriptors.

    ``arguments`` are its code folder, its role, the parent of private folders, the excluded modules and the import
    folders of its children.
    """
    padded_numbers = [
        f"{number:05}" for number in sockets
    ]  # constant length, because a command's length affects addresses
    # -I would ignore the hash seed.
    return [*_FIXED_ADDRESS_COMMAND, *build_python_command("-B", "-c", _START_CODE, *padded_numbers, *arguments)]


def build_environment() -> dict[str, str]:
    """Return the environment of a zygote, which contains nothing of the worker's environment."""
    return {
        "PATH": "/usr/bin:/bin",
        "LANG": "C.UTF-8",
        "MKL_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "2",
        "LOKY_MAX_CPU_COUNT": "1",
        "JOBLIB_MULTIPROCESSING": "0",
        "ORT_DISABLE_TELEMETRY": "1",
        **build_arithmetic_environment(),
    }
