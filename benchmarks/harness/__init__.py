"""Helpers shared by tests and benchmarks: a database server, fault injection, disguised copies.

Tests and benchmarks don't import each other.
"""
