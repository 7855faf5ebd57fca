"""Column types that work alike on SQLite and PostgreSQL: timestamps, exact decimals, untrusted text and JSON.

Independent of the tables.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime
from decimal import Decimal
from typing import Any

from sqlalchemy import (
    JSON,
    ClauseElement,
    ColumnElement,
    DateTime,
    Dialect,
    Float,
    Numeric,
    String,
    Text,
    TypeDecorator,
    cast,
)
from sqlalchemy.sql.operators import OperatorType
from sqlalchemy.types import TypeEngine

from service.store.codec import Json


def make_storable(text: str) -> str:
    """Replace NUL by U+2400 and lone surrogates by U+FFFD, so that every database accepts the text."""
    return text.replace("\0", "\u2400").encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def make_json_storable(value: Json) -> Json:
    """Apply ``make_storable`` to every string in a JSON value. Raises ValueError for infinite floats and NaN."""
    if isinstance(value, str):
        return make_storable(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"JSON has no {value}")
    if isinstance(value, list):
        return [make_json_storable(item) for item in value]
    if isinstance(value, dict):
        return {make_storable(key): make_json_storable(item) for key, item in value.items()}
    return value


class UtcDateTime(TypeDecorator[datetime]):
    """Timestamp column. Accepts only aware values and returns UTC. SQLite stores no zone."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Convert to UTC, without a zone for SQLite. Raises ValueError for a naive value."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"a moment needs its time zone: {value!r}")
        moment = value.astimezone(UTC)
        return moment.replace(tzinfo=None) if dialect.name == "sqlite" else moment

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Return an aware timestamp in UTC on every database."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class ExactDecimal(TypeDecorator[Decimal]):
    """Exact marks: NUMERIC on PostgreSQL, text on SQLite (whose numbers are binary floats).

    Queries compare them as numbers, because as text "8" differs from "8.0" and "10" sorts before "9".
    """

    impl = String(32)
    cache_ok = True

    class Comparator(TypeDecorator.Comparator[Decimal]):
        """Comparator that compares numbers, whatever type the database stores."""

        def operate(self, op: OperatorType, *other: Any, **kwargs: Any) -> ColumnElement[Any]:
            """Apply the operator to the numeric values of both sides."""
            numbers = (cast(each, Float) if _is_expression(each) else each for each in other)
            comparison: ColumnElement[Any] = op(cast(self.expr, Float), *numbers, **kwargs)
            return comparison

    comparator_factory: Any = Comparator

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """Return NUMERIC on PostgreSQL, otherwise text of at most 32 characters."""
        return dialect.type_descriptor(Numeric() if dialect.name == "postgresql" else String(32))

    def process_bind_param(self, value: Decimal | None, dialect: Dialect) -> Decimal | str | None:
        """Pass the number to PostgreSQL; convert it to text for other databases."""
        if value is None or dialect.name == "postgresql":
            return value
        return str(value)

    def process_result_value(self, value: Decimal | str | None, dialect: Dialect) -> Decimal | None:
        """Return the number with all stored digits."""
        return None if value is None else Decimal(value)


def _is_expression(value: Any) -> bool:
    return isinstance(value, ClauseElement) or hasattr(value, "__clause_element__")


class SafeText(TypeDecorator[str]):
    """Text that may come from a student's program."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        """Replace characters that a database would reject."""
        return None if value is None else make_storable(value)


class SafeJson(TypeDecorator[Any]):
    """JSON that may contain text of students; JSONB on PostgreSQL."""

    impl = JSON(none_as_null=True)
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """Return JSONB on PostgreSQL, otherwise JSON. None is stored as NULL on both."""
        if dialect.name != "postgresql":
            return dialect.type_descriptor(JSON(none_as_null=True))
        # Importing it loads all PostgreSQL drivers.
        from sqlalchemy.dialects.postgresql import JSONB

        return dialect.type_descriptor(JSONB(none_as_null=True))

    def process_bind_param(self, value: Json, dialect: Dialect) -> Json:
        """Make all strings storable. Raises ValueError for infinite floats and NaN."""
        return make_json_storable(value)
