"""Options that several commands share, and option groups: dataclasses whose fields are options."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from service.language import SOURCE_LANGUAGE, list_languages
from sim.errors import UsageError

if TYPE_CHECKING:
    from responders.channel import Channel

_INFRARED = ("beacon", "range", "facing", "blocked_by")


def create_format_option(help_text: str, names: Callable[[], Iterable[str]]) -> Any:
    """Return an option that accepts one of ``names``.

    ``names`` is called only when the option is used, because the formats load slowly.
    """

    def check_name(name: str) -> str:
        valid_names = tuple(names())
        if name not in valid_names:
            raise typer.BadParameter(f"{name!r} is not one of {', '.join(map(repr, valid_names))}")
        return name

    def complete_name(start: str) -> list[str]:
        return [name for name in names() if name.startswith(start)]

    return typer.Option("--format", help=help_text, metavar="FORMAT", callback=check_name, autocompletion=complete_name)


def _check_language(code: str) -> str:
    # English needs no catalogue, and listing the other languages is slow.
    if code != SOURCE_LANGUAGE and code not in list_languages():
        raise typer.BadParameter(f"{code!r} is not one of {', '.join(map(repr, list_languages()))}")
    return code


LanguageOption = Annotated[
    str,
    typer.Option(
        "--language",
        metavar="CODE",
        callback=_check_language,
        autocompletion=lambda: list(list_languages()),
        help="The language of reports and replays, for example de. Printed output stays in English.",
    ),
]


def _check_gif(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".gif":
        raise UsageError(f"--film {path}: expected a name that ends in .gif")
    return path


FilmOption = Annotated[
    Path | None, typer.Option("--film", callback=_check_gif, help="Write a film of one trial to this file, as GIF.")
]


def with_option_groups(command: Callable[..., None]) -> Callable[..., None]:
    """Replace each dataclass parameter of a command by its fields, for Typer.

    The fields need annotations and defaults, like the parameters of a command.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    parameters = list(_expand_parameters(inspect.signature(command).parameters, hints, groups))

    @functools.wraps(command)
    def expanded_command(**values: object) -> None:
        group_values = {
            name: group(**{each: values.pop(each) for each in _list_field_names(group)})
            for name, group in groups.items()
        }
        command(**values, **group_values)

    expanded_command.__signature__ = inspect.Signature(parameters, return_annotation=None)  # type: ignore[attr-defined]
    expanded_command.__annotations__ = {each.name: each.annotation for each in parameters} | {"return": None}
    del expanded_command.__wrapped__
    return expanded_command


def _expand_parameters(
    declared: Mapping[str, inspect.Parameter], hints: Mapping[str, Any], groups: Mapping[str, Any]
) -> Iterator[inspect.Parameter]:
    for name, parameter in declared.items():
        if name not in groups:
            yield parameter.replace(annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY)
            continue
        group_hints = get_type_hints(groups[name], include_extras=True)
        for group_field in fields(groups[name]):
            yield inspect.Parameter(
                group_field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=_find_default(group_field),
                annotation=group_hints[group_field.name],
            )


def _list_field_names(group: Any) -> list[str]:
    return [each.name for each in fields(group)]


def _find_default(field: Field[Any]) -> object:
    return inspect.Parameter.empty if field.default is MISSING else field.default


@dataclass(frozen=True, slots=True)
class ChannelFlags:
    """The channel flags as an option group."""

    link: Annotated[str | None, typer.Option("--link", help="cable or infrared.")] = None
    beacon: Annotated[
        str | None, typer.Option("--beacon", help="Position of the other end of an infrared link, mm.", metavar="X,Y")
    ] = None
    range: Annotated[float | None, typer.Option("--range", help="Range of an infrared link, mm.")] = None
    facing: Annotated[
        float | None,
        typer.Option("--facing", help="Opening angle of an infrared link in degrees, half of it on each side."),
    ] = None
    blocked_by: Annotated[str | None, typer.Option("--blocked-by", help="obstacles or nothing.")] = None
    loss: Annotated[
        float | None, typer.Option("--loss", help="Share of messages that are lost, in each direction.")
    ] = None
    delay: Annotated[float | None, typer.Option("--delay", help="Round-trip time of a message, in seconds.")] = None
    jitter: Annotated[float | None, typer.Option("--jitter", help="Maximum additional delay, in seconds.")] = None
    duplication: Annotated[float | None, typer.Option("--duplication", help="Share of messages that arrive twice.")] = (
        None
    )
    reordering: Annotated[
        float | None, typer.Option("--reordering", help="Share of messages that arrive out of order.")
    ] = None
    corruption: Annotated[
        float | None, typer.Option("--corruption", help="Share of messages with changed letters and digits.")
    ] = None

    def to_table(self) -> dict[str, object]:
        """Return the flags that were given, in the form of an assignment's channel table.

        Raises:
            UsageError: ``--beacon`` is not a pair of coordinates.
        """
        flags: dict[str, object] = {name: value for name, value in asdict(self).items() if value is not None}
        if self.beacon is not None:
            try:
                flags["beacon"] = [float(number) for number in self.beacon.split(",")]
            except ValueError:
                raise UsageError(f"--beacon is {self.beacon}, expected X,Y such as 1200,600") from None
        return flags


def apply_channel_flags(channel: Channel, flags: Mapping[str, object]) -> Channel:
    """Return the channel with the flags applied. Raises UsageError if the values are invalid."""
    if not flags:
        return channel
    from responders.channel import Channel
    from submissions.assignment.schema import ChannelTable
    from submissions.assignment.table_problems import read_table

    values = {each.name: getattr(channel, each.name) for each in fields(Channel)}
    unused_fields = _INFRARED if flags.get("link", channel.link) == "cable" else ()
    table = {name: value for name, value in values.items() if name not in unused_fields}
    channel_table = read_table(ChannelTable, {**table, **flags})
    if isinstance(channel_table, ChannelTable):
        return Channel(**channel_table.model_dump())
    raise UsageError("; ".join(problem.sentence.replace("this table", "the channel", 1) for problem in channel_table))
