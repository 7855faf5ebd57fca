"""Reads the list that Gradescope puts beside the submissions of an export: YAML as Ruby writes it, as plain data.

Who is meant by what it says is ``downloads.py``'s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from sim.errors import UsageError

_MOST_BYTES, _DEEPEST = 50_000_000, 100


def read_list(path: Path) -> dict[str, Any]:
    """The submissions by their folders. Every value is text, whatever Ruby calls it, and nothing is merged or made.

    Raises UsageError for what cannot be read as such a list.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise UsageError(f"{path.name}: is larger than {_MOST_BYTES // 10**6} MB, expected Gradescope's list.")
        _refuse_nested(data)
        listed = yaml.load(data, Loader=yaml.CBaseLoader)
    except OSError as error:
        raise UsageError(f"{path.name}: cannot be read: {error.strerror}.") from None
    except (yaml.YAMLError, RecursionError, UnicodeError) as error:
        mark = getattr(error, "problem_mark", None)
        line = "" if mark is None else f" at line {mark.line + 1}"
        raise UsageError(f"{path.name}: cannot be read{line}, expected Gradescope's list as it was exported.") from None
    if not isinstance(listed, dict):
        raise UsageError(f"{path.name}: is no list of submissions, expected Gradescope's as it was exported.")
    return {name: own for name, own in listed.items() if isinstance(name, str)}


def _refuse_nested(data: bytes) -> None:
    """Raises YAMLError for what is so deep that libyaml, whose parser goes down by itself, would run out of stack."""
    depth = 0
    for event in yaml.parse(data, Loader=yaml.CBaseLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise yaml.YAMLError("nested too deeply")
