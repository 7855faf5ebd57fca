"""The zygotes of a worker: started when first needed, one per role and set of excluded packages, closed together.

``zygote.py`` starts a zygote and checks that every layer isolates its children.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType

from responders.sandbox import access_times
from responders.sandbox.control_group import ControlGroup
from responders.sandbox.inside import grants
from responders.sandbox.isolation import FULL_ISOLATION, Isolation
from responders.sandbox.meter import JobMeter
from responders.sandbox.private_folders import PrivateFolders
from responders.sandbox.roles import ROLES, WITH_LIBRARIES, ChildRole, find_module_folder
from responders.sandbox.running_child import Child, ChildLimits
from responders.sandbox.served_child import ServedChild
from responders.sandbox.zygote import Zygote

#: Returns a real or a replayed child, from its role, its folder, its job's meter and a function that creates it.
ChildProvider = Callable[[str, Path | None, JobMeter | None, Callable[[], Child]], ServedChild]


class Sandboxes:
    """The zygotes of one worker: started when first needed, closed together, all in one ``group`` if given."""

    def __init__(self, isolation: Isolation = FULL_ISOLATION, group: ControlGroup | None = None) -> None:
        self.isolation = isolation
        self._group = group
        self._living: list[tuple[Child, int]] = []  # children in the group, with their memory limit
        self._zygotes: dict[tuple[ChildRole, tuple[str, ...]], Zygote] = {}
        self._folders = PrivateFolders()
        self._blamed = False
        self._stand_in: ChildProvider | None = None
        self._forgets_until = 0.0
        self._cpu_of_closed = 0.0
        self._given_libraries: JobMeter | None = None  # the meter of the last job that needed them

    def begin(self, role: ChildRole, exclusions: tuple[str, ...]) -> None:
        """Start the zygote for this role without waiting for it. Errors appear when it is used."""
        with contextlib.suppress(OSError):
            self._provide_zygote(role, exclusions).begin()

    def spawn(
        self, role: ChildRole, limits: ChildLimits, folder: Path | None = None, meter: JobMeter | None = None
    ) -> ServedChild:
        """Return a fresh child for a role, with or without a private folder.

        ``meter``, the meter of its job, counts its costs.
        """
        if self._stand_in is not None:
            return self._stand_in(role, folder, meter, lambda: self._fork(role, limits, folder, meter))
        return self._fork(role, limits, folder, meter)

    def _fork(self, role: ChildRole, limits: ChildLimits, folder: Path | None, meter: JobMeter | None) -> Child:
        if self._group is not None:
            self._living = [(child, allowed) for child, allowed in self._living if not child.is_closed]
            self._group.adjust_memory_limit(sum(allowed for _, allowed in self._living) + limits.memory_bytes)
        if meter is not None and meter is self._given_libraries:
            role = WITH_LIBRARIES[role]
        child = self._provide_zygote(role, limits.excluded_modules).spawn(limits, folder, meter, is_blamed=self._blamed)
        if self._group is not None:
            self._living.append((child, limits.memory_bytes))
        return child

    def enable_libraries(self, meter: JobMeter) -> None:
        """Load libraries in all further children of the job with this meter."""
        self._given_libraries = meter

    @contextlib.contextmanager
    def blaming(self) -> Iterator[None]:
        """Within this context, a child that is killed from outside counts as the cause."""
        self._blamed = True
        try:
            yield
        finally:
            self._blamed = False

    @contextlib.contextmanager
    def replacing_children(self, stand_in: ChildProvider) -> Iterator[None]:
        """Within this context, ``stand_in`` decides between a real child and a replayed one."""
        self._stand_in = stand_in
        try:
            yield
        finally:
            self._stand_in = None

    def check_isolation(self, role: ChildRole = "robot") -> str:
        """Run escape attempts in a child and return the layers that blocked them.

        Raises:
            SandboxMissing: If a required layer fails.
        """
        return self._provide_zygote(role).check_isolation()

    def check_bubblewrap(self, role: ChildRole = "robot") -> str | None:
        """Return why bubblewrap, which is optional, does not isolate children of ``role``; None if it does."""
        self.check_isolation(role)
        return self._provide_zygote(role).without_bubblewrap

    def check_data_leaks(self) -> str | None:
        """Return how a trial could leave data for a later one here, or None if it can't for the next hours."""
        now = time.time()
        if not 0 < self._forgets_until - now <= access_times.VALID_SECONDS:
            zygote = self._provide_zygote("robot")
            zygote.check_isolation()
            if zygote.without_doorkeeper is not None:
                return f"nobody decides which paths it may name ({zygote.without_doorkeeper})"
            if zygote.without_bubblewrap is not None:  # bubblewrap mounts read-only, so access times don't change
                module_folders = [find_module_folder(role) for role in ROLES]
                problem = access_times.read_beforehand(
                    grants.list_readable_paths(module_folders), grants.list_listable_folders(module_folders)
                )
                if problem is not None:
                    return problem
            self._forgets_until = now + access_times.VALID_SECONDS
        return None

    def open_private_folder(self) -> contextlib.AbstractContextManager[Path]:
        """Return a context manager for the folder of one trial, which is removed afterwards with all its content."""
        return self._folders.one()

    def _provide_zygote(self, role: ChildRole, exclusions: tuple[str, ...] = ()) -> Zygote:
        """Return the zygote for a role. Without some third-party packages, a second zygote is kept for the current job.

        Modules of Python's standard library are loaded in both and hidden in the child.
        """
        packages = tuple(name for name in exclusions if name.partition(".")[0] not in sys.stdlib_module_names)
        key = (role, packages)
        if key not in self._zygotes:
            for old_key in [other for other in self._zygotes if other[0] == role and other[1] and packages]:
                self._cpu_of_closed += self._zygotes[old_key].children_cpu_seconds
                self._zygotes.pop(old_key).close()
            self._zygotes[key] = Zygote(role, self.isolation, self._folders, self._group, packages)
        return self._zygotes[key]

    @property
    def children_cpu_seconds(self) -> float:
        """Processor time of all ended children."""
        return self._cpu_of_closed + sum(zygote.children_cpu_seconds for zygote in self._zygotes.values())

    def close(self) -> None:
        """Close all zygotes, and remove the control group and the private folders."""
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
