"""Readers of untrusted files and texts, one module per format, with limits on work as well as on bytes.

A reader counts values, keys, depth or entries before the format's own parser builds them, and raises
``UnreadableDataError`` if there are too many. Syntax errors keep the type of the format's parser, so that the
caller can locate them.
"""
