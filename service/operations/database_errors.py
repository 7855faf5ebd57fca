"""Errors of the database, for interfaces to catch and to answer."""

from __future__ import annotations

from enum import Enum, auto

from sqlalchemy.exc import DisconnectionError, InterfaceError, OperationalError
from sqlalchemy.exc import SQLAlchemyError as DatabaseError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from service.store.engine import is_conflict, is_overtaken

__all__ = ["DatabaseError", "DatabaseFailure", "classify"]
#: What is raised where the database cannot be reached, is busy for too long, or stops.
_AWAY = (OperationalError, InterfaceError, DisconnectionError, PoolTimeoutError)
#: Class of SQLSTATE of values that PostgreSQL cannot store; its driver raises the same error for a lost connection.
_PROGRAM_LIMIT = "54"


class DatabaseFailure(Enum):
    """Why the database did not do what it was asked."""

    CONFLICT = auto()  # somebody else changed the same at the same moment
    AWAY = auto()  # it cannot be reached, is busy for too long, or stops
    UNEXPECTED = auto()  # a mistake of ours


def classify(error: Exception) -> DatabaseFailure:
    """The kind of an error that the database raised."""
    if is_conflict(error) or is_overtaken(error):
        return DatabaseFailure.CONFLICT
    exceeds_limit = str(getattr(getattr(error, "orig", None), "sqlstate", None)).startswith(_PROGRAM_LIMIT)
    return DatabaseFailure.AWAY if isinstance(error, _AWAY) and not exceeds_limit else DatabaseFailure.UNEXPECTED
