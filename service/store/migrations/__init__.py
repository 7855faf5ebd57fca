"""Alembic revisions of the tables; included in the wheel."""
