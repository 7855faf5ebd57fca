"""Batches: intake, tables and views, publishing and regrading."""
