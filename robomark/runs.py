"""Run robot programs without marking, and read the replays of runs and grades."""

from __future__ import annotations

import base64
import os
import re
import zlib
from pathlib import Path
from typing import Any

from service.grading import standalone_runs
from service.grading.standalone_runs import RunOptions
from service.grading.trial_runner import TrialRunner
from service.reports.replay.document import FORMAT
from sim.errors import UsageError
from sim.readers.json_text import read_json
from sim.recording import Recording
from submissions.magics import parse_flags

_DATA_SCRIPT = re.compile(rb'<script type="application/json">(.*?)</script>')
_MAX_BYTES = 256 << 20
_MAX_VALUES = 20_000_000


def run_program(
    path: str | os.PathLike[str],
    flags: str = "",
    *,
    responder: str | None = None,
    seconds: float = 60.0,
    seed: int = 0,
) -> Recording:
    """Run a robot program in the sandbox and return its recording.

    Args:
        path: The robot program, a ``.py`` file.
        flags: Flags of ``%sim_magic`` that replace those in the program's first line, such as ``-b Lollipop -x 400``.
        responder: ``FILE`` or ``FILE:NAME`` of the responder that answers the program's messages.
        seconds: Limit on the simulated time.
        seed: Seed for everything random.

    Raises:
        UsageError: If a file can't be read, or a flag has an invalid value.
        HostError: If this machine can't run student code safely, or fails.
    """
    options = RunOptions(flags=parse_flags("sim_magic", flags), seconds=seconds, seed=seed)
    loaded_responder = None if responder is None else standalone_runs.load_responder(responder, options.limits)
    with TrialRunner() as runner:
        program = standalone_runs.read_program(Path(path))
        return standalone_runs.run_program(program, options, runner, responder=loaded_responder).recording


def read_replay(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the data of a replay or a report, from its page or its ``.json``, as described in ``docs/replay.md``.

    Raises:
        UsageError: If the file can't be read, or is not a replay.
    """
    file = Path(path)
    content = standalone_runs.read_file(file)
    try:
        data = read_json(content if file.suffix.lower() == ".json" else _unpack_page(content), max_values=_MAX_VALUES)
    except (ValueError, KeyError, TypeError, zlib.error) as error:
        raise UsageError(f"{file} is not a replay; expected a file that --replay or --report has written") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise UsageError(f"{file} is not a replay; expected a file that --replay or --report has written")
    return data


def _unpack_page(page: bytes) -> bytes:
    """Return the data of a page.

    Raises:
        ValueError: If the page has no data, or too much. Invalid data may also raise KeyError, TypeError or zlib.error.
    """
    match = _DATA_SCRIPT.search(page)
    if match is None:
        raise ValueError("the page has no data")
    unpack = zlib.decompressobj()
    data = unpack.decompress(base64.b64decode(read_json(match[1])["deflated"]), _MAX_BYTES)
    if unpack.unconsumed_tail:
        raise ValueError(f"the page has more than {_MAX_BYTES >> 20} MB of data")
    return data
