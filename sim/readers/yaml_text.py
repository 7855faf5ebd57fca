"""YAML reader with limits on values, depth and bytes. Scalars are texts; tags and merge keys have no effect."""

from __future__ import annotations

from typing import Any

import yaml

from sim.readers.reader_errors import MAX_DEPTH, TooManyValuesError, UnreadableDataError

MAX_BYTES = 20_000_000
#: Parser events: values, and starts or ends of lists and tables.
MAX_EVENTS = 500_000


def read_yaml(data: bytes) -> Any:
    """Parse the text and return the document.

    Raises:
        UnreadableDataError: The text is not YAML (the message has the line), or parsing takes too much work.
    """
    if len(data) > MAX_BYTES:
        raise UnreadableDataError("it is larger than %(most)s MB", most=MAX_BYTES // 10**6)
    try:
        _check_limits(data)
        return yaml.load(data, Loader=yaml.CBaseLoader)
    except (yaml.YAMLError, RecursionError, UnicodeError) as error:
        mark = getattr(error, "problem_mark", None)
        if mark is None:
            raise UnreadableDataError("it is not YAML") from None
        raise UnreadableDataError("it is not YAML at line %(line)s", line=mark.line + 1) from None


def _check_limits(data: bytes) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(data, Loader=yaml.CBaseLoader)):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        # libyaml recurses without a limit and would exhaust the stack.
        if depth > MAX_DEPTH:
            raise UnreadableDataError("it is nested too deeply")
        if count > MAX_EVENTS:
            raise TooManyValuesError("it has more than %(most)s values", most=MAX_EVENTS)
