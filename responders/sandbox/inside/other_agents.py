"""The other agents of a submission as functions. Arguments and results travel over the wire as JSON.

The worker decides whether an agent can be asked, and counts the costs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from typing import Any

from .call_results import as_json
from .frames import Wire, can_send_text


def build_agent_functions(
    names: Iterable[str], wire: Wire, advance_time: Callable[[int], None]
) -> dict[str, Callable[..., Any]]:
    """Return a function for each agent. ``advance_time`` is called with the time at which an answer arrives."""
    return {name: _build_agent_function(name, wire, advance_time) for name in names}


def _build_agent_function(name: str, wire: Wire, advance_time: Callable[[int], None]) -> Callable[..., Any]:
    def ask(*arguments: Any, **keywords: Any) -> Any:
        arguments_json, keywords_json = as_json(list(arguments)), as_json(keywords)
        if arguments_json is None or keywords_json is None:
            kinds = [type(each).__name__ for each in (*arguments, *keywords.values()) if as_json(each) is None]
            raise TypeError(
                f"{name} cannot be sent {' and '.join(kinds) or 'that'}: "
                "a message holds what JSON has, which are texts, numbers, lists and dictionaries"
            )
        if not can_send_text(arguments_json + keywords_json):
            length = len(arguments_json) + len(keywords_json)
            raise ValueError(f"{name} cannot be sent {length} characters of JSON at once; the most is about 60000")
        wire.send({"do": "ask", "agent": name, "arguments": arguments_json, "named": keywords_json})
        reply = wire.receive()
        advance_time(reply["t"])
        if reply["kind"] == "error":
            raise RuntimeError(reply["text"])
        return json.loads(reply["text"])

    ask.__name__ = ask.__qualname__ = name
    ask._robomark_noted = True  # type: ignore[attr-defined]  # the worker notes it
    return ask
