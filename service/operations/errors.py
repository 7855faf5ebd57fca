"""Reasons why an operation refuses; each interface renders them in its reader's language.

Each carries a message template and its parameters, as every ``RobomarkError`` does.
"""

from __future__ import annotations

from sim.errors import UsageError


class OperationError(UsageError):
    """Base of all refusals of operations."""


class NotFound(OperationError):
    """The object does not exist, or the actor may not know that it exists (HTTP 404)."""


class Forbidden(OperationError):
    """The actor may see the object but not do this with it (HTTP 403)."""


class Conflict(OperationError):
    """The object has changed since the actor saw it, or its state does not allow the action (HTTP 409)."""


class Invalid(OperationError):
    """The request itself cannot be carried out, for example because a value is out of range (HTTP 422)."""
