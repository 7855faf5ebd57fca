"""Store the token that started a session, so that the session ends with it.

Existing sessions have no token: they end a week after they began.
"""

from __future__ import annotations

from alembic import op

from service.store.migrate import refuse_downgrade

revision = "0018"
down_revision = "0017"


def upgrade() -> None:
    # One statement, which SQLite can run without rebuilding the table.
    op.execute(
        "ALTER TABLE credential ADD COLUMN token_id VARCHAR(12) "
        "CONSTRAINT fk_credential_token_id_credential REFERENCES credential (id)"
    )
    op.create_index("ix_credential_token_id", "credential", ["token_id"])


downgrade = refuse_downgrade
