"""Reruns: a stored trial runs again with exactly one ingredient exchanged, to show why a criterion lost marks.

Reruns are evidence. They are never marked and never stored as trials.
"""
