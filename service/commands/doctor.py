"""``robomark doctor``: problems that prevent grading on this machine. ``service/doctor.py`` contains the checks."""

from __future__ import annotations

from service.commands.shown import document, show, table
from sim.errors import HostError


def doctor() -> None:
    """Look at everything that grading needs on this machine; exit status 3 if something is wrong."""
    from rich.text import Text

    from service.doctor import examine
    from service.settings import load_settings

    findings = examine(load_settings())
    looked_at = table("", "", "")
    for finding in findings:
        mark = Text("ok", style="green") if finding.well else Text("wrong", style="red")
        looked_at.add_row(mark, finding.what, finding.sentence)
    document(findings=findings)
    show(looked_at)
    wrong = [finding.what for finding in findings if not finding.well]
    if wrong:
        raise HostError(f"problems: {', '.join(wrong)}")
