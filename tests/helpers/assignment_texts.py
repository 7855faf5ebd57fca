"""Texts of small assignments, for tests that read or grade them."""

from __future__ import annotations


def build_run_text(name: str, *criteria: str, poses: str = "[[200, 800, 0]]", ends: str = "") -> str:
    """Return an assignment with runs of four seconds without a responder, and the criterion ``ends`` before the others.

    ``criteria`` are whole tables without their heading; ``ends`` are further lines of the first.
    """
    head = f"""\
id = "{name}"
title = "Say the number"
[parts]
responder = "none"
[[scenario]]
id = "run"
poses = {poses}
seconds = 4
"""
    first = f'id = "ends"\ntitle = "Ends"\nmarks = 2\ncheck = "finishes"\n{ends}\n'
    return head + "".join(f"[[criterion]]\n{each}" for each in (first, *criteria))
