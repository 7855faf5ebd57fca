"""Runs the ``robomark`` command as a user does, in a separate process each time.

Most processes are forked from one that has already loaded the modules, because loading takes seconds. Tests of the
steps before loading start a new process.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

COMMAND = [sys.executable, "-c", "from service.cli import main; main()"]
#: Processes of this context start with the modules of the store, the grader and the reports already loaded.
FORKING = multiprocessing.get_context("forkserver")
FORKING.set_forkserver_preload(
    [
        "service.command_line",
        "service.store.batches.regrades",
        "service.report_files",
        "service.grading.grader",
        "sklearn",
    ]
)
_PATIENCE = 240


def robomark(
    *arguments: str | Path, folder: Path | None = None, umask: int | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the forked command in ``folder``, with files instead of a terminal, and ``environment`` added to ours."""
    words = [str(argument) for argument in arguments]
    with tempfile.TemporaryDirectory() as made:
        out, err = Path(made) / "out", Path(made) / "err"
        given = (words, folder or Path.cwd(), umask, {**os.environ, **environment}, out, err)
        process = FORKING.Process(target=_run, args=given)
        process.start()
        process.join(_PATIENCE)
        if process.exitcode is None:
            process.kill()
            process.join()
        status = process.exitcode
        process.close()
        return subprocess.CompletedProcess(words, status or 0, out.read_text("utf-8"), err.read_text("utf-8"))


def robomark_anew(
    *arguments: str | Path, out: int = subprocess.PIPE, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run the command in a new process, as a shell does."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        env=os.environ | environment,
        stdout=out,
        stderr=subprocess.PIPE,
        text=True,
        timeout=_PATIENCE,
        check=False,
    )


def _run(
    words: list[str], folder: Path, umask: int | None, environment: Mapping[str, str], out: Path, err: Path
) -> None:
    for number, path in ((1, out), (2, err)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    if umask is not None:
        os.umask(umask)
    sys.argv = ["robomark", *words]
    from service.cli import main

    main()
