"""Output of services: JSON from the first line in a file or pipe, readable lines at a terminal."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys

_CODE = (
    "import logging, structlog\n"
    "from service.queue.logs import print_event, configure_logging\n"
    "configure_logging('INFO')\n"
    "print_event('up.ready', 'ready: 2 gradings at a time')\n"
    "structlog.get_logger('ours').warning('job.lost', job='j1')\n"
    "logging.getLogger('theirs').error('no broker')\n"
)
_OF_LIBRARIES = """
import warnings
from billiard.util import error, get_logger
from service.queue.logs import configure_logging
get_logger()
configure_logging('INFO')
warnings.warn('run as root')
error('Process %r exited', 'SpawnPoolWorker-1')
"""


def test_a_pipe_gets_json_from_the_first_line() -> None:
    ended = subprocess.run([sys.executable, "-c", _CODE], capture_output=True, text=True, check=True)
    (announced,) = map(json.loads, ended.stdout.splitlines())
    assert (announced["event"], announced["message"]) == ("up.ready", "ready: 2 gradings at a time")
    ours, theirs = map(json.loads, ended.stderr.splitlines())
    assert (ours["event"], ours["job"], ours["level"]) == ("job.lost", "j1", "warning")
    assert (theirs["event"], theirs["level"]) == ("no broker", "error")


def test_what_libraries_say_in_ways_of_their_own_is_json_too() -> None:
    ended = subprocess.run([sys.executable, "-c", _OF_LIBRARIES], capture_output=True, text=True, check=True)
    warned, exited = map(json.loads, ended.stderr.splitlines())
    assert "run as root" in warned["event"]
    assert exited["event"] == "Process 'SpawnPoolWorker-1' exited"


def test_a_terminal_gets_lines_for_a_person() -> None:
    ours, its = pty.openpty()
    environment = {**os.environ, "NO_COLOR": "1"}
    subprocess.run([sys.executable, "-c", _CODE], stdout=its, stderr=its, env=environment, check=True)
    output = os.read(ours, 65536).decode()
    for end in (ours, its):
        os.close(end)
    first, second, third = output.splitlines()
    assert first == "ready: 2 gradings at a time"
    assert "job.lost" in second
    assert "job=j1" in second
    assert "no broker" in third
    assert "\x1b" not in output
    assert "{" not in output


def test_a_trace_at_a_terminal_has_no_values() -> None:
    code = (
        "import structlog\n"
        "from service.queue.logs import configure_logging\n"
        "configure_logging('INFO')\n"
        "def sign_in(password):\n    raise ValueError('wrong')\n"
        "try:\n    sign_in('se' + 'cret')\n"
        "except ValueError:\n    structlog.get_logger('ours').exception('failed')\n"
    )
    ours, its = pty.openpty()
    subprocess.run([sys.executable, "-c", code], stdout=its, stderr=its, check=True)
    output = os.read(ours, 65536).decode()
    for end in (ours, its):
        os.close(end)
    assert "ValueError: wrong" in output
    assert "secret" not in output
