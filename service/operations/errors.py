"""Errors of operations; each interface renders them in its reader's language.

Each has a message template and its parameters, like every ``RobomarkError``.
"""

from __future__ import annotations

from sim.errors import UsageError


class OperationError(UsageError):
    """Base of all errors of operations."""


class NotFound(OperationError):
    """The object does not exist, or the actor may not know that it exists (HTTP 404)."""


class Forbidden(OperationError):
    """The actor may see the object, but does not have permission for the action (HTTP 403)."""


class Conflict(OperationError):
    """The object has changed since the actor read it, or its state does not allow the action (HTTP 409)."""


class Invalid(OperationError):
    """The request is invalid, for example because a value is out of range (HTTP 422)."""
