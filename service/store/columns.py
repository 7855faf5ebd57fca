"""Column types that behave alike on SQLite and PostgreSQL: moments, exact decimals, strangers' text and JSON.

Knows no table.
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


def storable(text: str) -> str:
    """Text that every database takes: no NUL (shown as its image), no lone surrogates (shown as U+FFFD)."""
    return text.replace("\0", "\u2400").encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def storable_json(value: Json) -> Json:
    """The same for every string inside a JSON value; refuses floats that JSON has no word for."""
    if isinstance(value, str):
        return storable(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"JSON has no {value}")
    if isinstance(value, list):
        return [storable_json(item) for item in value]
    if isinstance(value, dict):
        return {storable(key): storable_json(item) for key, item in value.items()}
    return value


class UtcDateTime(TypeDecorator[datetime]):
    """A moment; only aware values go in, UTC comes out. SQLite forgets the zone, PostgreSQL gives its own."""

    impl = DateTime(timezone=True)
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """The moment in UTC, for SQLite without its zone; raises ValueError where it has none."""
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError(f"a moment needs its time zone: {value!r}")
        moment = value.astimezone(UTC)
        return moment.replace(tzinfo=None) if dialect.name == "sqlite" else moment

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """The moment in UTC, aware on every database."""
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class ExactDecimal(TypeDecorator[Decimal]):
    """Marks, exactly: NUMERIC on PostgreSQL, text on SQLite (whose own numbers are binary).

    Queries compare them as numbers: as text "8" is not "8.0", and "10" comes before "9".
    """

    impl = String(32)
    cache_ok = True

    class Comparator(TypeDecorator.Comparator[Decimal]):
        """Compares the number, whatever the database stores."""

        def operate(self, op: OperatorType, *other: Any, **kwargs: Any) -> ColumnElement[Any]:
            """The operation on the numbers of both sides."""
            numbers = (cast(each, Float) if _is_expression(each) else each for each in other)
            compared: ColumnElement[Any] = op(cast(self.expr, Float), *numbers, **kwargs)
            return compared

    comparator_factory: Any = Comparator

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """NUMERIC on PostgreSQL, else text of at most 32 characters."""
        return dialect.type_descriptor(Numeric() if dialect.name == "postgresql" else String(32))

    def process_bind_param(self, value: Decimal | None, dialect: Dialect) -> Decimal | str | None:
        """The number itself for PostgreSQL, else its digits as text."""
        if value is None or dialect.name == "postgresql":
            return value
        return str(value)

    def process_result_value(self, value: Decimal | str | None, dialect: Dialect) -> Decimal | None:
        """The number, with every digit that was stored."""
        return None if value is None else Decimal(value)


def _is_expression(value: Any) -> bool:
    return isinstance(value, ClauseElement) or hasattr(value, "__clause_element__")


class SafeText(TypeDecorator[str]):
    """Text that may have come from a student's program."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:
        """The text without what a database would refuse."""
        return None if value is None else storable(value)


class SafeJson(TypeDecorator[Any]):
    """JSON that may hold a student's text; JSONB on PostgreSQL."""

    impl = JSON(none_as_null=True)
    cache_ok = True

    def load_dialect_impl(self, dialect: Dialect) -> TypeEngine[Any]:
        """JSONB on PostgreSQL, else JSON; None is NULL on both."""
        if dialect.name != "postgresql":
            return dialect.type_descriptor(JSON(none_as_null=True))
        # With it come all the drivers that there are for PostgreSQL.
        from sqlalchemy.dialects.postgresql import JSONB

        return dialect.type_descriptor(JSONB(none_as_null=True))

    def process_bind_param(self, value: Json, dialect: Dialect) -> Json:
        """The value with texts that every database takes; raises ValueError for infinity and what is no number."""
        return storable_json(value)
