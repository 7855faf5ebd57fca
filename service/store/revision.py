"""The revision of a database's tables, and whether the code that runs here can use them. Only reads.

``migrate.py`` brings the tables up to date. A migration says which revision's code can still use the tables after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sqlalchemy import Engine, column, inspect, select, table
from sqlalchemy.engine import Connection
from sqlalchemy.orm import Session

_TABLE = "alembic_version"
_COMPATIBILITY = table("schema_compatibility", column("oldest_compatible"))
_NEWER_ADVICE = "install the newer release and restart"
_OLDER_ADVICE = "robomark db upgrade"


@cache
def newest_revision() -> str:
    """The newest revision that the running code knows; a migration's file is named after its own: ``v0009_people.py``.

    It is read once: another release can be installed in the same place while this process runs.
    """
    files = (Path(__file__).parent / "migrations" / "versions").glob("v*.py")
    return max(file.name[1:5] for file in files)


@dataclass(frozen=True, slots=True)
class SchemaState:
    """The revision of a database's tables, None for an empty one, and the oldest revision whose code can use them."""

    revision: str | None
    oldest_compatible: str

    @property
    def is_usable(self) -> bool:
        """Whether the code that runs here can use the tables as they are."""
        return self.revision is not None and self.oldest_compatible <= newest_revision() <= self.revision

    @property
    def problem(self) -> str:
        """Why the tables cannot be used, with the fix; empty where they can."""
        if self.is_usable or self.revision is None:
            return ""
        advice = _OLDER_ADVICE if self.revision < newest_revision() else _NEWER_ADVICE
        return f"at revision {self.revision}, this Robomark at {newest_revision()}: {advice}"


def current_revision(engine: Engine) -> str | None:
    """The revision the database is at; None for an empty one."""
    with engine.begin() as connection:
        return revision_of(connection)


def revision_of(connection: Connection) -> str | None:
    """The revision the database is at, asked in a transaction of the caller's; None for an empty one."""
    if not inspect(connection).has_table(_TABLE):
        return None
    found: str | None = connection.scalar(select(column("version_num")).select_from(table(_TABLE)))
    return found


def schema_state(engine: Engine) -> SchemaState:
    """The revision of the database and what can use it. Tables of before 0017 can be used by their own code alone."""
    with engine.begin() as connection:
        revision = revision_of(connection)
        oldest = None
        if revision is not None and inspect(connection).has_table(_COMPATIBILITY.name):
            oldest = connection.scalar(select(_COMPATIBILITY.c.oldest_compatible))
        return SchemaState(revision, oldest or revision or "")


def needs_newer_code(session: Session) -> bool:
    """Whether a migration has made the tables unfit for the code that runs here."""
    return str(session.scalar(select(_COMPATIBILITY.c.oldest_compatible)) or "") > newest_revision()
