"""``robomark notebook-engine``: the process behind RoboLab in a notebook. Programs start it, not people."""

from __future__ import annotations

import os
from contextlib import suppress

from sim.errors import Cancelled


def notebook_engine() -> None:
    """Run robots and checks for a notebook: one line of JSON per request on stdin, one per event on stdout."""
    # Requests come at once, and nothing else may be written between the events.
    from service.notebook_engine.lines import EventLines, RequestLines

    requests, events = RequestLines(os.dup(0)), EventLines(os.dup(1))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    from responders.sandbox.manager import Sandboxes

    with Sandboxes() as sandboxes:
        # Its imports are loaded while this process loads its own.
        sandboxes.begin("robot", ())
        from service.grading.trial_runner import TrialRunner
        from service.notebook_engine.local_engine import serve_notebook

        # The notebook has ended: there is nobody to tell.
        with TrialRunner(sandboxes) as runner, suppress(Cancelled):
            serve_notebook(requests, events, runner)
