"""The secret of this installation, which its worlds depend on: the environment's where it is set, else the database's.

It was made with the tables, goes wherever they go, and is shown nowhere; only its hash is.
"""

from __future__ import annotations

from sqlalchemy import select

from service.store.engine import Store
from service.store.models import Installation
from sim.errors import HostError
from submissions.seeds import Secret


def secret_of(store: Store) -> Secret:
    """The secret that trials are run with. Raises HostError when the database has lost its own."""
    if store.secret is not None:
        return store.secret
    with store.reading() as session:
        return secret_read(session.scalar(select(Installation.secret)))


def secret_read(text: str | None) -> Secret:
    """The database's own secret as it was read. Raises HostError where it is gone."""
    if text is None:
        raise HostError("The database is damaged: the secret that it was made with is gone; restore a backup")
    return Secret(text)
