"""Context of operations: the service that they act on, and the actor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from service.settings import Settings
from service.store import audit
from service.store.engine import Store as Store
from service.store.engine import open_store as open_store
from service.store.people.reach import UNLIMITED_REACH, Reach
from service.store.states import JobQueue, Role


class WorkerNotifier(Protocol):
    """Interface for notifying workers, implemented by ``service.queue.notifier``."""

    def grade(self, lane: JobQueue, count: int = 1) -> None:
        """Notify for ``count`` jobs of a queue."""

    def notify_test_runs(self, count: int = 1) -> None:
        """Notify for ``count`` test runs."""

    def plot(self, count: int = 1) -> None:
        """Notify for the plots of ``count`` jobs."""


@dataclass(frozen=True, slots=True)
class Service:
    """An installation: its settings, its database, and the notifier of its workers."""

    settings: Settings
    store: Store
    notifier: WorkerNotifier


@dataclass(frozen=True, slots=True)
class Actor:
    """The person or program that requests an operation.

    ``name`` is written to the activity log. Commands on the machine act as an operator without a ``person_id``.
    ``reach`` is that of the actor's credential.
    """

    name: str
    person_id: int | None = None
    operator: bool = False
    roles: Mapping[int, Role] = field(default_factory=dict)  # by course
    reach: Reach = UNLIMITED_REACH
    credential_id: str = ""

    @property
    def is_machine(self) -> bool:
        """Return whether the actor is a command on the machine, which has the permissions of every role."""
        return self.operator and self.person_id is None


def create_machine_actor() -> Actor:
    """Return the actor of a command on the machine, named after the account that runs it."""
    return Actor(audit.describe_current_user(), operator=True)
