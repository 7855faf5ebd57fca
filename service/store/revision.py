"""Revision of a database's tables, and its compatibility with the running code. Read-only.

``migrate.py`` creates and upgrades the tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from sqlalchemy import Engine, Select, column, inspect, select, table
from sqlalchemy.engine import Connection
from sqlalchemy.orm import Session

from sim.sentences import Sentence

#: The oldest revision whose code can use the tables of the newest one. Code older than 0025 publishes grades without
#: statements, which ``robomark log check`` names; code older than 0026 shows grades before they are released.
OLDEST_COMPATIBLE = "0019"
_TABLE = "alembic_version"
_COMPATIBILITY = table("schema_compatibility", column("oldest_compatible"))
_NEWER_ADVICE = Sentence("install the newer release and restart")
_OLDER_ADVICE = "robomark db upgrade"


@cache
def find_newest_revision() -> str:
    """Return the newest revision that the running code knows, from the migrations' file names (``v0009_people.py``).

    Cached, because another release can be installed in the same place while this process runs.
    """
    files = (Path(__file__).parent / "migrations" / "versions").glob("v*.py")
    return max(file.name[1:5] for file in files)


@dataclass(frozen=True, slots=True)
class SchemaState:
    """The revision of a database's tables (None if empty), and the oldest revision whose code can use them."""

    revision: str | None
    oldest_compatible: str

    @property
    def is_usable(self) -> bool:
        """Return whether the running code can use the tables."""
        return self.revision is not None and self.oldest_compatible <= find_newest_revision() <= self.revision

    @property
    def problem(self) -> str:
        """Return the reason why the tables are unusable, with the fix; empty if they are usable."""
        if self.is_usable or self.revision is None:
            return ""
        advice = _OLDER_ADVICE if self.revision < find_newest_revision() else _NEWER_ADVICE
        return Sentence(
            "at revision %(revision)s, this Robomark at %(own)s: %(advice)s",
            revision=self.revision,
            own=find_newest_revision(),
            advice=advice,
        )


def load_current_revision(engine: Engine) -> str | None:
    """Return the revision of the database; None for an empty one."""
    with engine.begin() as connection:
        return read_revision(connection)


def read_revision(connection: Connection) -> str | None:
    """Return the revision of the database within the caller's transaction; None for an empty one."""
    if not inspect(connection).has_table(_TABLE):
        return None
    revision: str | None = connection.scalar(select(column("version_num")).select_from(table(_TABLE)))
    return revision


def load_schema_state(engine: Engine) -> SchemaState:
    """Return the revision of the database and its compatibility. Before 0017, only the same revision is compatible."""
    with engine.begin() as connection:
        revision = read_revision(connection)
        oldest_revision = None
        if revision is not None and inspect(connection).has_table(_COMPATIBILITY.name):
            oldest_revision = connection.scalar(select(_COMPATIBILITY.c.oldest_compatible))
        return SchemaState(revision, oldest_revision or revision or "")


def needs_newer_code(session: Session) -> bool:
    """Return whether a migration has made the tables unusable for the running code."""
    return is_newer_than_code(session.scalar(select_oldest_compatible()))


def select_oldest_compatible() -> Select[str]:
    """Return a query for the oldest revision whose code can use the tables."""
    return select(_COMPATIBILITY.c.oldest_compatible)


def is_newer_than_code(oldest_compatible: str | None) -> bool:
    """Return whether tables for which this revision is the oldest compatible one are unusable for the running code."""
    return str(oldest_compatible or "") > find_newest_revision()
