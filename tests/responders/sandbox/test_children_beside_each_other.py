"""A group has enough memory for all children that run in it at once, and no more."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from responders.sandbox.control_group import ControlGroup
from responders.sandbox.isolation import FULL_ISOLATION
from responders.sandbox.manager import Sandboxes
from responders.sandbox.running_child import ChildLimits


class Noted:
    """Replaces a group and records the requests."""

    command_prefix: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.rooms: list[int] = []

    def adjust_memory_limit(self, limits_bytes: int) -> None:
        self.rooms.append(limits_bytes >> 20)

    def watch_memory_kills(self) -> Callable[[], bool]:
        return lambda: False

    def close(self) -> None:
        """Do nothing: there are no resources to release."""


def test_there_is_room_for_those_that_live_at_once() -> None:
    group = Noted()
    with Sandboxes(FULL_ISOLATION, cast(ControlGroup, group)) as sandboxes:
        first = sandboxes.spawn("robot", ChildLimits(1, 100 << 20))
        second = sandboxes.spawn("robot", ChildLimits(1, 70 << 20))
        first.close()
        third = sandboxes.spawn("robot", ChildLimits(1, 64 << 20))
        second.close()
        third.close()
        sandboxes.spawn("robot", ChildLimits(1, 80 << 20)).close()
    assert group.rooms == [100, 170, 134, 80]
