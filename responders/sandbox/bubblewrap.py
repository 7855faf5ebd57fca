"""Optional isolation with bubblewrap: a zygote in its own namespaces that sees only the folders that Python needs.

The sandbox keeps its guarantees without it. With it, student code also can't discover outside file names, processes or
the host name.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

_PROGRAM = shutil.which("bwrap", path="/usr/bin:/bin:/usr/local/bin")
_SYSTEM_PATHS = ("/usr", "/lib", "/lib64", "/bin", "/etc/alternatives", "/etc/localtime", "/etc/ld.so.cache")
_DEVICES = ("/dev/null", "/dev/zero")
_NAMESPACE_OPTIONS = ("--unshare-ipc", "--unshare-pid", "--unshare-net", "--unshare-uts", "--unshare-cgroup-try")
#: Capabilities for a zygote that runs as root. It needs them to run each child as a separate user, and SETPCAP to keep
#: its addresses fixed; it drops SETPCAP at its start. Children drop all of them.
_CAPABILITIES = ("CHOWN", "DAC_OVERRIDE", "KILL", "SETGID", "SETPCAP", "SETUID")
_TRIAL_SECONDS = 20.0


def build_command_prefix(readable: list[str], writable: Path) -> list[str]:
    """Return the command prefix that runs the interpreter in its own namespaces.

    Besides the interpreter, the process can read ``readable`` and write ``writable``. It is the first process in its
    PID namespace, so no other process there outlives it.
    """
    command = [
        _PROGRAM or "bwrap",
        *_NAMESPACE_OPTIONS,
        "--die-with-parent",
        "--as-pid-1",
        "--new-session",
        "--hostname",
        "robot",
    ]
    command += ["--cap-drop", "ALL"]
    if os.geteuid() == 0:
        for power in _CAPABILITIES:
            command += ["--cap-add", f"CAP_{power}"]
    else:
        command.append("--unshare-user")
    visible_paths = (*_list_interpreter_folders(), *readable)
    for folder in _list_parent_folders(*_SYSTEM_PATHS, *_DEVICES, *visible_paths, str(writable)):
        # Folders that bubblewrap creates itself are accessible only to root.
        command += ["--dir", folder]
    for path in _SYSTEM_PATHS:
        command += ["--ro-bind-try", path, path]
    for path in visible_paths:
        command += ["--ro-bind", path, path]
    for path in _DEVICES:
        command += ["--dev-bind", path, path]
    return [*command, "--bind", str(writable), str(writable), "--proc", "/proc", "--chdir", "/", "--"]


def _list_parent_folders(*paths: str) -> list[str]:
    return sorted({str(folder) for path in paths for folder in Path(path).parents} - {"/"})


def check_available(wrapping: list[str]) -> str | None:
    """Run an interpreter that does nothing. Return the reason if that fails here, or None if it works."""
    if _PROGRAM is None:
        return "bwrap is not installed"
    try:
        result = subprocess.run(
            [*wrapping, sys.executable, "-I", "-S", "-c", "pass"],
            env={},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=_TRIAL_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"bwrap does not run: {error}"
    if result.returncode != 0:
        error_lines = result.stderr.strip().splitlines()
        return error_lines[-1][:200] if error_lines else f"bwrap ends with status {result.returncode}"
    return None


def _list_interpreter_folders() -> list[str]:
    """Return the folders of the interpreter and its packages, including the base of a virtual environment."""
    program = Path(sys.executable)
    folders = {sys.prefix, sys.base_prefix, str(program.parent.parent), str(program.resolve().parent.parent)}
    return sorted(folders - {"/", "/usr"})
