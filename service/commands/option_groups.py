"""Lets commands take groups of options: a dataclass each, whose fields are options of the command."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, get_type_hints


def with_option_groups(command: Callable[..., None]) -> Callable[..., None]:
    """The command as Typer shall see it: each parameter that is a dataclass is replaced by its fields.

    Fields are annotated and have their defaults as the parameters of a command do.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    parameters = list(_parameters(inspect.signature(command).parameters, hints, groups))

    @functools.wraps(command)
    def called(**given: object) -> None:
        made = {name: group(**{each: given.pop(each) for each in _names(group)}) for name, group in groups.items()}
        command(**given, **made)

    called.__signature__ = inspect.Signature(parameters, return_annotation=None)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters} | {"return": None}
    del called.__wrapped__
    return called


def _parameters(
    declared: Mapping[str, inspect.Parameter], hints: Mapping[str, Any], groups: Mapping[str, Any]
) -> Iterator[inspect.Parameter]:
    for name, parameter in declared.items():
        if name not in groups:
            yield parameter.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY)
            continue
        own = get_type_hints(groups[name], include_extras=True)
        for each in fields(groups[name]):
            yield inspect.Parameter(
                each.name, inspect.Parameter.KEYWORD_ONLY, default=_default(each), annotation=own[each.name]
            )


def _names(group: Any) -> list[str]:
    return [each.name for each in fields(group)]


def _default(field: Field[Any]) -> object:
    return inspect.Parameter.empty if field.default is MISSING else field.default
