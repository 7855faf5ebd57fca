"""Start of all Robomark processes: outside the current folder, and without the user's Python settings.

Users may run a command in a folder of submissions. Robomark does not import files in that folder or read settings from
it.
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

#: Working folder of all processes started here, and of services. Only root can create files in it.
SAFE_FOLDER = "/"
#: Variables that make a library run or read an arbitrary file.
_REMOVED_VARIABLES = frozenset({"MATPLOTLIBRC", "MPLBACKEND", "CELERY_CONFIG_MODULE", "CELERY_LOADER"})
#: One thread, and one iteration order for sets of texts.
_SAME_ORDER: Mapping[str, str] = MappingProxyType(
    {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
)
#: One set of numpy kernels, and the processor features they require. Newer features are disabled, because the order of
#: additions affects the last bits of results.
_SAME_KERNELS: Mapping[str, str] = MappingProxyType(
    {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}
)
_KERNELS_NEED = frozenset({"avx2", "fma"})
_OUR_PACKAGES = str(Path(__file__).absolute().parents[1])


def build_python_command(*arguments: str) -> list[str]:
    """Return the command line of this interpreter, without the current folder and the user's packages on its path."""
    return [sys.executable, "-P", "-s", *arguments]


def build_clean_environment(extra_variables: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without variables that redirect Python or libraries, plus ``extra_variables``."""
    variables = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTHON") and name not in _REMOVED_VARIABLES
    }
    # For child processes of the started process, such as the pool children of a worker.
    return variables | {"PYTHONSAFEPATH": "1", "PYTHONNOUSERSITE": "1"} | dict(extra_variables)


@functools.cache
def build_arithmetic_environment() -> dict[str, str]:
    """Return the variables that make a process compute the same bits on every machine.

    Processors without AVX2 or FMA, such as x86-64 servers until 2013, use their own kernels.
    """
    try:
        flags = next(line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        flags = ""
    return dict(_SAME_ORDER) | (dict(_SAME_KERNELS) if set(flags.split()) >= _KERNELS_NEED else {})


def launch_process(
    command: Sequence[str], extra: Mapping[str, str] | None = None, **options: Any
) -> subprocess.Popen[Any]:
    """Start ``command``; ``options`` are those of ``subprocess.Popen``, without folder and environment.

    Raises:
        OSError: The process cannot be started.
    """
    return subprocess.Popen(command, cwd=SAFE_FOLDER, env=build_clean_environment(extra or {}), **options)


def leave_current_folder() -> None:
    """Change to the safe folder and remove the current one from the import path, before a service starts.

    Libraries look for modules and settings in the working folder, regardless of the import path.
    """
    foreign_paths = {str(Path.cwd())} - {_OUR_PACKAGES}
    sys.path[:] = [folder for folder in sys.path if folder.startswith("/") and folder not in foreign_paths]
    os.chdir(SAFE_FOLDER)
    os.environ.update(PYTHONSAFEPATH="1", PYTHONNOUSERSITE="1")
