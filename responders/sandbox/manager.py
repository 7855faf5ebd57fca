"""The zygotes of a worker: started when first needed, told apart by what their children do without, ended together.

What a zygote is, and that every wall stands round its children, is ``zygote.py``'s.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType

from responders.sandbox import reading_dates
from responders.sandbox.control_group import ControlGroup
from responders.sandbox.inside import grants
from responders.sandbox.meter import JobMeter
from responders.sandbox.private_folders import PrivateFolders
from responders.sandbox.running_child import Child, ChildLimits, ServedChild
from responders.sandbox.zygote import FULL, ROLES, WITH_LIBRARIES, Isolation, Role, Zygote, own_modules

#: Of a role, its folder, its job's meter and what makes a child: the child, or what stands for it.
StandIn = Callable[[str, Path | None, JobMeter | None, Callable[[], Child]], ServedChild]


class Sandboxes:
    """The zygotes of one worker: started when first needed, ended together, and all in one ``group`` if given."""

    def __init__(self, isolation: Isolation = FULL, group: ControlGroup | None = None) -> None:
        self.isolation = isolation
        self._group = group
        self._living: list[tuple[Child, int]] = []  # in the group, each with the bytes that it may have
        self._zygotes: dict[tuple[Role, tuple[str, ...]], Zygote] = {}
        self._folders = PrivateFolders()
        self._blamed = False
        self._stand_in: StandIn | None = None
        self._forgets_until = 0.0
        self._cpu_of_closed = 0.0
        self._given_libraries: JobMeter | None = None  # the meter of the last job that had to have them

    def begin(self, role: Role, without: tuple[str, ...]) -> None:
        """Start what children of this role will come from, and wait for nothing; what is wrong with it shows then."""
        with contextlib.suppress(OSError):
            self._zygote(role, without).begin()

    def spawn(
        self, role: Role, limits: ChildLimits, folder: Path | None = None, meter: JobMeter | None = None
    ) -> ServedChild:
        """A fresh child for a robot program or a responder, in a ``private_folder`` or without one.

        What it costs is counted by ``meter``, that of its job.
        """
        if self._stand_in is not None:
            return self._stand_in(role, folder, meter, lambda: self._fork(role, limits, folder, meter))
        return self._fork(role, limits, folder, meter)

    def _fork(self, role: Role, limits: ChildLimits, folder: Path | None, meter: JobMeter | None) -> Child:
        if self._group is not None:
            self._living = [(child, allowed) for child, allowed in self._living if not child.closed]
            self._group.make_room(sum(allowed for _, allowed in self._living) + limits.memory_bytes)
        if meter is not None and meter is self._given_libraries:
            role = WITH_LIBRARIES[role]
        child = self._zygote(role, limits.without).spawn(limits, folder, meter, blamed=self._blamed)
        if self._group is not None:
            self._living.append((child, limits.memory_bytes))
        return child

    def give_libraries(self, meter: JobMeter) -> None:
        """From now on all children of the job that has this meter have libraries loaded."""
        self._given_libraries = meter

    @contextlib.contextmanager
    def blaming(self) -> Iterator[None]:
        """Meanwhile a child that is killed from outside is to blame for it."""
        self._blamed = True
        try:
            yield
        finally:
            self._blamed = False

    @contextlib.contextmanager
    def standing_in(self, stand_in: StandIn) -> Iterator[None]:
        """Meanwhile ``stand_in`` says whether a child is needed, or what stands for it."""
        self._stand_in = stand_in
        try:
            yield
        finally:
            self._stand_in = None

    def check(self, role: Role = "robot") -> str:
        """Let a child try to get out of its sandbox; say which layers hold. Raises SandboxMissing if any does not."""
        return self._zygote(role).try_isolation()

    def why_no_bubblewrap(self, role: Role = "robot") -> str | None:
        """What keeps bubblewrap, an extra, from standing round children of ``role``; None if it does."""
        self.check(role)
        return self._zygote(role).without_bubblewrap

    def remembers(self) -> str | None:
        """Why a trial here could leave something for a later one to find; None for the next hours if it cannot."""
        now = time.time()
        if not 0 < self._forgets_until - now <= reading_dates.HOLDS_SECONDS:
            zygote = self._zygote("robot")
            zygote.try_isolation()
            if zygote.without_doorkeeper is not None:
                return f"nobody decides which paths it may name ({zygote.without_doorkeeper})"
            if zygote.without_bubblewrap is not None:  # in there nothing is dated, as it is mounted for reading only
                own = [own_modules(role) for role in ROLES]
                dated = reading_dates.read_beforehand(grants.readable(own), grants.listable(own))
                if dated is not None:
                    return dated
            self._forgets_until = now + reading_dates.HOLDS_SECONDS
        return None

    def private_folder(self) -> contextlib.AbstractContextManager[Path]:
        """A folder for one trial, removed afterwards whatever the student's code has put into it."""
        return self._folders.one()

    def _zygote(self, role: Role, without: tuple[str, ...] = ()) -> Zygote:
        """Beside the usual one of a role there is one without some packages, for the job at hand.

        Python's own modules are loaded in both: they are put away in the child.
        """
        packages = tuple(name for name in without if name.partition(".")[0] not in sys.stdlib_module_names)
        key = (role, packages)
        if key not in self._zygotes:
            for other in [other for other in self._zygotes if other[0] == role and other[1] and packages]:
                self._cpu_of_closed += self._zygotes[other].children_cpu_seconds
                self._zygotes.pop(other).close()
            self._zygotes[key] = Zygote(role, self.isolation, self._folders, self._group, packages)
        return self._zygotes[key]

    @property
    def children_cpu_seconds(self) -> float:
        """What all children that are gone have used."""
        return self._cpu_of_closed + sum(zygote.children_cpu_seconds for zygote in self._zygotes.values())

    def close(self) -> None:
        """End all zygotes, and remove the control group and the private folders."""
        while self._zygotes:
            self._zygotes.popitem()[1].close()
        if self._group is not None:
            self._group.close()
        self._folders.close()

    def __enter__(self) -> Sandboxes:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
