"""What operations work with: the service they act on, and the actor who asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from service.settings import Settings
from service.store import audit
from service.store.engine import Store as Store
from service.store.engine import open_store as open_store
from service.store.people.credentials import EVERYWHERE, Reach
from service.store.states import Lane, Role


class WorkerNotices(Protocol):
    """Tells workers that there is work, as ``service.queue.notifier`` does."""

    def grade(self, lane: Lane, count: int = 1) -> None:
        """Notify for ``count`` jobs of a lane."""

    def try_out(self, count: int = 1) -> None:
        """Notify for ``count`` programs that students run without submitting them."""

    def plot(self, count: int = 1) -> None:
        """Notify for the plots of ``count`` jobs."""


@dataclass(frozen=True, slots=True)
class Service:
    """One installation: its settings, its database, and the notifier of its workers."""

    settings: Settings
    store: Store
    notifier: WorkerNotices


@dataclass(frozen=True, slots=True)
class Actor:
    """The person or program that asks for an operation.

    ``name`` is what the activity log records. Commands on the machine itself are those of an operator without a
    ``person_id``. ``reach`` is that of the credential that the actor signed in with.
    """

    name: str
    person_id: int | None = None
    operator: bool = False
    roles: Mapping[int, Role] = field(default_factory=dict)  # by course
    reach: Reach = EVERYWHERE
    credential_id: str = ""

    @property
    def is_machine(self) -> bool:
        """Whether this is a command on the machine itself, which may do what every role may."""
        return self.operator and self.person_id is None


def machine_operator() -> Actor:
    """The operator that a command on the machine itself acts as: the account that runs it."""
    return Actor(audit.this_user(), operator=True)
