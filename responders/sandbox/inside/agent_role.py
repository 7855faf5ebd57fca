"""The role of an agent: loads its module once, then calls its function with one message after another.

The worker decides who may ask the agent, and when.
"""

from __future__ import annotations

import functools
import json
import types
from collections.abc import Callable
from typing import Any

from . import call_results
from .frames import Frame, Wire
from .lockdown import Grants
from .responder_role import ResponderRole


class AgentRole(ResponderRole):
    """A student's module that answers the responder and the other agents."""

    def __init__(self, wire: Wire, grants: Grants, spec: Frame) -> None:
        super().__init__(wire, grants, spec)
        self._own_name = spec["agent"]

    def _serve_messages(self) -> None:
        while True:
            question = self._wire.receive()
            self._units = max(self._units, question["t"])
            self._wrap_functions()
            self._stack, self._calls = [self._own_name], 0
            self._wire.send(call_results.build_result_frame(functools.partial(self._call_agent, question), self._files))

    def _call_agent(self, question: Frame) -> Any:
        return self._find_function()(*json.loads(question["arguments"]), **json.loads(question["named"]))

    def _find_function(self) -> Callable[..., Any]:
        """Return the agent's function: the one with its name, else the only ``*_<name>``, else the only function."""
        name = self._own_name
        own_function = self._namespace.get(name)
        if callable(own_function):
            return own_function  # type: ignore[no-any-return]
        named_functions = [
            (each, value)
            for each, value in self._namespace.items()
            if isinstance(value, types.FunctionType) and value.__module__ == "__main__"
        ]
        functions = [value for each, value in named_functions if each.endswith(f"_{name}")] or [
            value for _, value in named_functions
        ]
        if len(functions) == 1:
            return functions[0]
        if functions:
            names = ", ".join(each for each, _ in named_functions)
            raise LookupError(f"which of {names} is the {name}? call one of them {name}")
        raise LookupError(f"there is no {name}: define a function called {name}")
