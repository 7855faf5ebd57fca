"""Base of all tables: the names of constraints, and the column type of each Python type.

``columns.py`` contains the types.
"""

from __future__ import annotations

from datetime import datetime
from decimal import Decimal
from enum import StrEnum
from typing import Any

from sqlalchemy import Enum, MetaData
from sqlalchemy.orm import DeclarativeBase

from service.store.columns import ExactDecimal, SafeJson, SafeText, UtcDateTime
from service.store.states import (
    BatchState,
    CancelReason,
    CompletionRule,
    CountedAttempt,
    CredentialKind,
    JobQueue,
    JobState,
    PlotState,
    ReleaseRule,
    Role,
    Standing,
)


def _build_enum_type(kind: type[StrEnum]) -> Enum:
    return Enum(
        kind,
        native_enum=False,
        length=16,
        create_constraint=False,
        values_callable=lambda values: [value.value for value in values],
    )


class Base(DeclarativeBase):
    """Base of all tables: the names of constraints, and the column type of each Python type."""

    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
    type_annotation_map = {  # noqa: RUF012 - SQLAlchemy reads it as a class attribute
        datetime: UtcDateTime(),
        Decimal: ExactDecimal(),
        str: SafeText(),
        Any: SafeJson(),
        Role: _build_enum_type(Role),
        CountedAttempt: _build_enum_type(CountedAttempt),
        CompletionRule: _build_enum_type(CompletionRule),
        ReleaseRule: _build_enum_type(ReleaseRule),
        CredentialKind: _build_enum_type(CredentialKind),
        JobQueue: _build_enum_type(JobQueue),
        JobState: _build_enum_type(JobState),
        CancelReason: _build_enum_type(CancelReason),
        PlotState: _build_enum_type(PlotState),
        BatchState: _build_enum_type(BatchState),
        Standing: _build_enum_type(Standing),
    }
