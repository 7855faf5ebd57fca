"""The command and the environment that zygotes are started with: the same for all, so that their children are alike.

Hashes, the order of sets, the kernels that compute and, where the machine allows it, addresses are fixed here.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from responders.sandbox.processor import ALLOWED
from sim.processes import python_command, same_arithmetic

#: The beginning of a command whose memory lies at the same addresses each time, where the machine allows that: objects
#: are hashed by theirs. What it sets is inherited, so a process of its own does it, and not the worker. An exec that
#: gives root powers back undoes it; bubblewrap's root keeps the right to give that up (SECBIT_NOROOT) for this alone.
_FIXED_ADDRESSES = (
    sys.executable,
    *("-I", "-S", "-c"),
    "import ctypes, os, sys; libc = ctypes.CDLL(None); "
    "PR_SET_SECUREBITS, NOROOT_LOCKED, PR_CAP_AMBIENT, IS_SET, LOWER, CAP_SETPCAP = 28, 3, 47, 1, 3, 8; "
    "in_bubblewrap = libc.prctl(PR_CAP_AMBIENT, IS_SET, CAP_SETPCAP, 0, 0) == 1; "
    "in_bubblewrap and libc.prctl(PR_SET_SECUREBITS, NOROOT_LOCKED, 0, 0, 0); "
    "in_bubblewrap and libc.prctl(PR_CAP_AMBIENT, LOWER, CAP_SETPCAP, 0, 0); "
    "libc.personality(0x40000); os.execv(sys.argv[1], sys.argv[1:])",
)
_BEGIN = (
    f"import os, sys; os.sched_setaffinity(0, {sorted(ALLOWED)}); "
    "high = [os.dup2(int(fd), 100 + place) for place, fd in enumerate(sys.argv[1:3])]; "
    "os.dup2(high[0], 3); os.dup2(high[1], 4); os.closerange(5, 1 << 16); sys.path.insert(0, sys.argv[3]); "
    "from inside.zygote import main; main(sys.argv[4], sys.argv[5], sys.argv[6].split(), sys.argv[7:])"
)


def command(sockets: Sequence[int], arguments: Sequence[str]) -> list[str]:
    """Return the command of a zygote that has these two descriptors for its own sockets.

    ``arguments`` are the folder of its code, its role, the folder of private folders, the modules that it does without
    and the folders that its children import from.
    """
    padded = [f"{number:05}" for number in sockets]  # how long a command is shows in addresses
    # Not with -I, which would ignore the seed of hashes.
    return [*_FIXED_ADDRESSES, *python_command("-B", "-c", _BEGIN, *padded, *arguments)]


def environment() -> dict[str, str]:
    """Return all that a zygote finds in its environment: nothing of ours."""
    return {
        "PATH": "/usr/bin:/bin",
        "LANG": "C.UTF-8",
        "MKL_NUM_THREADS": "1",
        "MALLOC_ARENA_MAX": "2",
        "LOKY_MAX_CPU_COUNT": "1",
        "JOBLIB_MULTIPROCESSING": "0",
        "ORT_DISABLE_TELEMETRY": "1",
        **same_arithmetic(),
    }
