"""Classification of database errors, for interfaces to catch and report."""

from __future__ import annotations

from enum import Enum, auto

from sqlalchemy.exc import DisconnectionError, InterfaceError, OperationalError
from sqlalchemy.exc import SQLAlchemyError as DatabaseError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.store.engine import is_conflict, is_overtaken

__all__ = ["DatabaseError", "DatabaseFailure", "classify"]
#: Raised if the database is unreachable, busy for too long, or shutting down.
_UNREACHABLE_ERRORS = (OperationalError, InterfaceError, DisconnectionError, PoolTimeoutError)
#: SQLSTATE class of values that PostgreSQL cannot store; its driver raises the same error for a lost connection.
_PROGRAM_LIMIT = "54"


class DatabaseFailure(Enum):
    """The reason why a database operation failed."""

    CONFLICT = auto()  # a concurrent change of the same data
    AWAY = auto()  # unreachable, busy for too long, or shutting down
    UNEXPECTED = auto()  # an error in Robomark


def classify(error: Exception) -> DatabaseFailure:
    """Return the kind of a database error."""
    if is_conflict(error) or is_overtaken(error):
        return DatabaseFailure.CONFLICT
    exceeds_limit = str(getattr(getattr(error, "orig", None), "sqlstate", None)).startswith(_PROGRAM_LIMIT)
    return (
        DatabaseFailure.AWAY
        if isinstance(error, _UNREACHABLE_ERRORS) and not exceeds_limit
        else DatabaseFailure.UNEXPECTED
    )
