"""Readers of files and texts that other people made: one module per format, bounded by work and not by bytes alone.

A reader counts what the text would become (values, keys, depth, entries) before the format's own parser builds it, and
raises ``Unreadable`` where that is too much. Syntax errors stay those of the format, for the caller to locate.
"""
