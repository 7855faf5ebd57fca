"""The flags of ``run`` and ``grade`` that change the channel: the keys of an assignment's channel, one flag each.

What they may be is said by the assignment's own table; nothing that is kept is changed by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Annotated

import typer

from sim.errors import UsageError

if TYPE_CHECKING:
    from responders.channel import Channel

_INFRARED = ("beacon", "range", "facing", "blocked_by")


@dataclass(frozen=True, slots=True)
class ChannelFlags:
    """The flags, as a group of options."""

    link: Annotated[str | None, typer.Option("--link", help="cable or infrared.")] = None
    beacon: Annotated[
        str | None, typer.Option("--beacon", help="Where an infrared link's other end stands, mm.", metavar="X,Y")
    ] = None
    range: Annotated[float | None, typer.Option("--range", help="How far an infrared link reaches, mm.")] = None
    facing: Annotated[
        float | None, typer.Option("--facing", help="The angle in which it does, degrees, half to either side.")
    ] = None
    blocked_by: Annotated[str | None, typer.Option("--blocked-by", help="obstacles or nothing.")] = None
    loss: Annotated[float | None, typer.Option("--loss", help="Share of messages that is lost, each way.")] = None
    delay: Annotated[float | None, typer.Option("--delay", help="Seconds there and back.")] = None
    jitter: Annotated[float | None, typer.Option("--jitter", help="Seconds more, at most.")] = None
    duplication: Annotated[float | None, typer.Option("--duplication", help="Share that comes twice.")] = None
    reordering: Annotated[float | None, typer.Option("--reordering", help="Share that others overtake.")] = None
    corruption: Annotated[
        float | None, typer.Option("--corruption", help="Share that comes with other letters and digits.")
    ] = None

    def given(self) -> dict[str, object]:
        """Those that were given, as an assignment's table has them. Raises UsageError for a beacon that is no place."""
        given: dict[str, object] = {name: value for name, value in asdict(self).items() if value is not None}
        if self.beacon is not None:
            try:
                given["beacon"] = [float(number) for number in self.beacon.split(",")]
            except ValueError:
                raise UsageError(f"--beacon is {self.beacon}, expected X,Y such as 1200,600") from None
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
