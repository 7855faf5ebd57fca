"""Robomark's service: grading, store, queue, reports, web pages and command line."""
