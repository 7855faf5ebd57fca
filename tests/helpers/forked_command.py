"""Running the ``robomark`` command in many processes, each forked from one that has loaded what they all need."""

from __future__ import annotations

import multiprocessing
import os
import sys
from dataclasses import dataclass
from pathlib import Path

_FORKING = multiprocessing.get_context("forkserver")
_FORKING.set_forkserver_preload(["service.command_line", "service.store.regrades", "service.report_files", "sklearn"])


@dataclass(frozen=True)
class EndedCommand:
    status: int | None
    out: str
    err: str


def forked(folder: Path, *words: str, **environment: str) -> EndedCommand:
    """The command with these words, run in ``folder``, with pipes' worth of files in place of a terminal."""
    out, err = folder / ".out", folder / ".err"
    process = _FORKING.Process(target=_run, args=(folder, words, environment, out, err))
    process.start()
    process.join(240)
    assert process.exitcode is not None
    return EndedCommand(process.exitcode, out.read_text(), err.read_text())


def _run(folder: Path, words: tuple[str, ...], environment: dict[str, str], out: Path, err: Path) -> None:
    for number, path in ((1, out), (2, err)):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), number)
    os.chdir(folder)
    os.environ.update(environment)
    sys.argv = ["robomark", *words]
    from service.command_line import main

    main()
