"""Robomark as it is used: grading, the store, the queue, reports, pages and the command line."""
