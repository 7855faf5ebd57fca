"""Signed statements on grades, receipts of submissions, and the hash tree over all statements.

Independent of the database: the modules build, sign and check bytes. ``service.store.statement_log`` stores them.
"""
