"""Starts every process of ours: outside of the current folder, and without the user's settings for Python.

Whoever runs a command may stand in a folder of submissions. No file in it is imported, or read as a setting, by us.
"""

from __future__ import annotations

import functools
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

#: The working folder of all that we start, and of services: nobody but root can put a file there.
SAFE_FOLDER = "/"
#: Variables that make a library run or read a file of somebody's choice.
_LEFT_OUT = frozenset({"MATPLOTLIBRC", "MPLBACKEND", "CELERY_CONFIG_MODULE", "CELERY_LOADER"})
#: One thread, and one order in sets of texts.
_SAME_ORDER: Mapping[str, str] = MappingProxyType(
    {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
)
#: One kind of kernels for matrices and functions of numpy, and what a processor must have to run it. What newer ones
#: have besides is left unused: the order in which numbers are added decides their last bits.
_SAME_KERNELS: Mapping[str, str] = MappingProxyType(
    {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}
)
_KERNELS_NEED = frozenset({"avx2", "fma"})
_OUR_PACKAGES = str(Path(__file__).absolute().parents[1])


def python_command(*arguments: str) -> list[str]:
    """The command line of this interpreter, with neither the current folder nor a user's packages on its path."""
    return [sys.executable, "-P", "-s", *arguments]


def clean_environment(extra: Mapping[str, str]) -> dict[str, str]:
    """Our environment without what directs Python and libraries, and with these variables beside it."""
    kept = {
        name: value for name, value in os.environ.items() if not name.startswith("PYTHON") and name not in _LEFT_OUT
    }
    # For the processes that these start in turn, such as the pool children of a worker.
    return kept | {"PYTHONSAFEPATH": "1", "PYTHONNOUSERSITE": "1"} | dict(extra)


@functools.cache
def same_arithmetic() -> dict[str, str]:
    """The variables of a process that computes to the bit as such a process on any other machine does.

    A processor without AVX2 or FMA, as x86-64 servers had until 2013, computes as it can.
    """
    try:
        flags = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        flags = ""
    return dict(_SAME_ORDER) | (dict(_SAME_KERNELS) if set(flags.split()) >= _KERNELS_NEED else {})


def start(command: Sequence[str], extra: Mapping[str, str] | None = None, **options: Any) -> subprocess.Popen[Any]:
    """Start ``command``; ``options`` are those of ``subprocess.Popen`` but for its folder and environment.

    Raises OSError when it cannot be started.
    """
    return subprocess.Popen(command, cwd=SAFE_FOLDER, env=clean_environment(extra or {}), **options)


def leave_current_folder() -> None:
    """Move this process to the safe folder and take the current one off its path, before a service begins here.

    Libraries look for modules and settings where a process stands, whatever its path is.
    """
    not_ours = {str(Path.cwd())} - {_OUR_PACKAGES}
    sys.path[:] = [folder for folder in sys.path if folder.startswith("/") and folder not in not_ours]
    os.chdir(SAFE_FOLDER)
    os.environ.update(PYTHONSAFEPATH="1", PYTHONNOUSERSITE="1")
