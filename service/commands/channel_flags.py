"""The flags of ``run`` and ``grade`` that change the channel: the keys of an assignment's channel, one flag each.

What they may be is said by the assignment's own table; nothing that is kept is changed by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any

import typer

from responders.channel import Channel
from sim.errors import UsageError
from submissions.assignment.schema import ChannelTable, read_table

_PANEL = "Channel"
_INFRARED = ("beacon", "range", "facing", "blocked_by")


def _flag(name: str, words: str, **more: Any) -> Any:
    return typer.Option(name, help=words, rich_help_panel=_PANEL, show_default=False, **more)


Link = Annotated[str | None, _flag("--link", "cable or infrared.")]
Beacon = Annotated[str | None, _flag("--beacon", "Where an infrared link's other end stands, mm.", metavar="X,Y")]
Range = Annotated[float | None, _flag("--range", "How far an infrared link reaches, mm.")]
Facing = Annotated[float | None, _flag("--facing", "The angle in which it does, degrees, half to either side.")]
BlockedBy = Annotated[str | None, _flag("--blocked-by", "obstacles or nothing.")]
Loss = Annotated[float | None, _flag("--loss", "Share of messages that is lost, each way.")]
Delay = Annotated[float | None, _flag("--delay", "Seconds there and back.")]
Jitter = Annotated[float | None, _flag("--jitter", "Seconds more, at most.")]
Duplication = Annotated[float | None, _flag("--duplication", "Share that comes twice.")]
Reordering = Annotated[float | None, _flag("--reordering", "Share that others overtake.")]
Corruption = Annotated[float | None, _flag("--corruption", "Share that comes with other letters and digits.")]


def given_flags(**flags: object) -> dict[str, object]:
    """The flags that were given, as an assignment's table has them. Raises UsageError for a beacon that is no place."""
    given = {name: value for name, value in flags.items() if value is not None}
    if "beacon" in given:
        try:
            given["beacon"] = [float(number) for number in str(given["beacon"]).split(",")]
        except ValueError:
            raise UsageError(f"--beacon is {given['beacon']}, expected X,Y such as 1200,600") from None
    return given


def changed(channel: Channel, given: Mapping[str, object]) -> Channel:
    """The channel with what the flags say. Raises UsageError where it cannot be so."""
    if not given:
        return channel
    values = {each.name: getattr(channel, each.name) for each in fields(Channel)}
    needless = _INFRARED if given.get("link", channel.link) == "cable" else ()
    table = {name: value for name, value in values.items() if name not in needless}
    read = read_table(ChannelTable, {**table, **given})
    if isinstance(read, ChannelTable):
        return Channel(**read.model_dump())
    raise UsageError("; ".join(problem.sentence.replace("this table", "the channel", 1) for problem in read))
