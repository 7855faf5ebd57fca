"""``robomark`` in a separate home, at a terminal so wide that no table is wrapped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import command


@dataclass(frozen=True)
class Ended:
    status: int
    out: str
    err: str


def robomark(home: Path, *arguments: str | Path, **environment: Any) -> Ended:
    """Run the command with its home in ``home``. Fails on a traceback."""
    ended = command.robomark(*arguments, ROBOMARK_HOME=str(home), **{"COLUMNS": "200", **environment})
    assert "Traceback" not in ended.stderr
    return Ended(ended.returncode, ended.stdout, ended.stderr)
