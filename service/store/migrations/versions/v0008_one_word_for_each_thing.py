"""Rename tables, columns and files to the terms used elsewhere in Robomark, without changing their content."""

from __future__ import annotations

from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0008"
down_revision = "0007"

_TABLES = {"canary": "self_test", "presence": "heartbeat"}
_COLUMNS = (
    ("submission", "handed_in_at", "submitted_at"),
    ("job", "nudged_at", "notified_at"),
    ("job", "walls", "sandbox"),
    ("job", "fresh", "forced"),
    ("criterion_result", "sights", "predictions"),
    ("worker", "canary_at", "self_tested_at"),
    ("heartbeat", "walls", "sandbox"),
)


def upgrade() -> None:
    op.drop_index("ix_canary_worker_process", "canary")
    op.drop_index("ix_presence_seen_at", "presence")
    for before, after in _TABLES.items():
        op.rename_table(before, after)
    # One statement each, without rebuilding a table: SQLite would empty the tables that refer to it, by cascade.
    for table, before, after in _COLUMNS:
        op.execute(f"ALTER TABLE {table} RENAME COLUMN {before} TO {after}")
    op.create_index("ix_self_test_worker_process", "self_test", ["worker", "process"], unique=True)
    op.create_index("ix_heartbeat_seen_at", "heartbeat", ["seen_at"])
    op.execute("UPDATE artifact SET name = 'plot-predictions-' || substr(name, 13) WHERE name LIKE 'plot-sights-%'")
    op.execute(
        "UPDATE job SET error = 'superseded by a newer submission' WHERE error = 'superseded by a newer hand-in'"
    )


downgrade = refuse_downgrade
