"""The secret of this installation, which determines its worlds: from the environment, or else from the database.

It is created with the tables and included in backups. Only its hash is ever shown.
"""

from __future__ import annotations

from sqlalchemy import select

from service.store.engine import Store
from service.store.tables.installation import Installation
from sim.errors import HostError
from submissions.seeds import Secret


def load_secret(store: Store) -> Secret:
    """Return the secret that trials are run with. Raises HostError if the database has lost its secret."""
    if store.secret is not None:
        return store.secret
    with store.reading() as session:
        return require_secret(session.scalar(select(Installation.secret)))


def require_secret(text: str | None) -> Secret:
    """Return the database's secret from its column. Raises HostError if it is missing."""
    if text is None:
        raise HostError("The database is damaged: the secret that it was made with is gone; restore a backup")
    return Secret(text)
