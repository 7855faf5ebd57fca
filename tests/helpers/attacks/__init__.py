"""Attacks by students: each function is one attack, run as student code inside a sandboxed child.

An attack returns a true value when it succeeds. An exception, an empty result or the end of its process is a failure.
"""
