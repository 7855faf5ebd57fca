"""YAML, bounded by its values, their depth and their bytes; every scalar is text, and nothing is made or merged."""

from __future__ import annotations

from typing import Any

import yaml

from sim.readers.unreadable import DEEPEST, TooMany, Unreadable

MOST_BYTES = 20_000_000
#: Events of the parser: a value, or the beginning or end of a list or table.
MOST_EVENTS = 500_000


def read_yaml(data: bytes) -> Any:
    """Return the document. Raises Unreadable for what is no YAML, with its line, or would take too much work."""
    if len(data) > MOST_BYTES:
        raise Unreadable("it is larger than %(most)s MB", most=MOST_BYTES // 10**6)
    try:
        _check(data)
        return yaml.load(data, Loader=yaml.CBaseLoader)
    except (yaml.YAMLError, RecursionError, UnicodeError) as error:
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            raise Unreadable("it is not YAML") from None
        raise Unreadable("it is not YAML at line %(line)s", line=mark.line + 1) from None


def _check(data: bytes) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(data, Loader=yaml.CBaseLoader)):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        # libyaml goes down by itself, and would run out of stack.
        if depth > DEEPEST:
            raise Unreadable("it is nested too deeply")
        if count > MOST_EVENTS:
            raise TooMany("it has more than %(most)s values", most=MOST_EVENTS)
