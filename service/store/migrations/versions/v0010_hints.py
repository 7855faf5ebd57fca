"""Add hints to a grade: sentences on the probable causes of lost marks. Earlier grades have none."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

from service.store.columns import SafeJson
from service.store.migrate import refuse_downgrade

revision = "0010"
down_revision = "0009"


def upgrade() -> None:
    op.add_column("job", sa.Column("hints", SafeJson(), nullable=False, server_default="[]"))


downgrade = refuse_downgrade
