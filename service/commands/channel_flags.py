"""The flags of ``run`` and ``grade`` that change the channel: the keys of an assignment's channel, one flag each.

What they may be is said by the assignment's own table; nothing that is kept is changed by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated

import typer

from sim.errors import UsageError

if TYPE_CHECKING:
    from responders.channel import Channel

_INFRARED = ("beacon", "range", "facing", "blocked_by")

LinkFlag = Annotated[str | None, typer.Option("--link", help="cable or infrared.")]
BeaconFlag = Annotated[
    str | None, typer.Option("--beacon", help="Where an infrared link's other end stands, mm.", metavar="X,Y")
]
RangeFlag = Annotated[float | None, typer.Option("--range", help="How far an infrared link reaches, mm.")]
FacingFlag = Annotated[
    float | None, typer.Option("--facing", help="The angle in which it does, degrees, half to either side.")
]
BlockedByFlag = Annotated[str | None, typer.Option("--blocked-by", help="obstacles or nothing.")]
LossFlag = Annotated[float | None, typer.Option("--loss", help="Share of messages that is lost, each way.")]
DelayFlag = Annotated[float | None, typer.Option("--delay", help="Seconds there and back.")]
JitterFlag = Annotated[float | None, typer.Option("--jitter", help="Seconds more, at most.")]
DuplicationFlag = Annotated[float | None, typer.Option("--duplication", help="Share that comes twice.")]
ReorderingFlag = Annotated[float | None, typer.Option("--reordering", help="Share that others overtake.")]
CorruptionFlag = Annotated[
    float | None, typer.Option("--corruption", help="Share that comes with other letters and digits.")
]


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
    from responders.channel import Channel
    from submissions.assignment.schema import ChannelTable, read_table

    values = {each.name: getattr(channel, each.name) for each in fields(Channel)}
    needless = _INFRARED if given.get("link", channel.link) == "cable" else ()
    table = {name: value for name, value in values.items() if name not in needless}
    read = read_table(ChannelTable, {**table, **given})
    if isinstance(read, ChannelTable):
        return Channel(**read.model_dump())
    raise UsageError("; ".join(problem.sentence.replace("this table", "the channel", 1) for problem in read))
