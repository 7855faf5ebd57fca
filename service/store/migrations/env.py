"""Alembic environment: runs revisions on the connection from ``service.store.migrate`` and opens none."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from alembic import context
from alembic.runtime.migration import MigrationContext, MigrationInfo
from alembic.script import Script
from sqlalchemy import delete, insert

from service.store.tables import METADATA
from service.store.tables.installation import SchemaCompatibility


def _write_oldest_compatible(
    ctx: MigrationContext, step: MigrationInfo, heads: Collection[Any], run_args: Mapping[str, Any]
) -> None:
    """Store the oldest revision whose code can use the tables, after a migration that names one."""
    script = step.up_revision
    oldest_revision = getattr(script.module, "OLDEST_COMPATIBLE", None) if isinstance(script, Script) else None
    if ctx.connection is not None and oldest_revision is not None:
        ctx.connection.execute(delete(SchemaCompatibility))
        ctx.connection.execute(insert(SchemaCompatibility).values(id=1, oldest_compatible=oldest_revision))


context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=METADATA,
    render_as_batch=True,
    compare_type=True,
    on_version_apply=_write_oldest_compatible,
)
with context.begin_transaction():
    context.run_migrations()
