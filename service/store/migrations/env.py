"""Runs revisions on the connection that ``service.store.migrate`` hands over; opens none itself."""

from __future__ import annotations

from alembic import context

from service.store.web_tables import METADATA

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=METADATA,
    render_as_batch=True,
    compare_type=True,
)
with context.begin_transaction():
    context.run_migrations()
