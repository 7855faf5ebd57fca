"""Alembic's revisions of the tables; carried in the wheel."""
