"""``robomark doctor``: problems that prevent grading on this machine. ``service/doctor.py`` contains the checks."""

from __future__ import annotations

from service.commands.output import create_table, print_json, print_renderables
from sim.errors import HostError


def doctor() -> None:
    """Look at everything that grading needs on this machine; exit status 3 if something is wrong."""
    from rich.text import Text

    from service.doctor import examine_machine
    from service.settings import load_settings

    findings = examine_machine(load_settings())
    table = create_table("", "", "")
    for finding in findings:
        mark = Text("ok", style="green") if finding.well else Text("wrong", style="red")
        table.add_row(mark, finding.what, finding.sentence)
    print_json(findings=findings)
    print_renderables(table)
    failed_checks = [finding.what for finding in findings if not finding.well]
    if failed_checks:
        raise HostError(f"problems: {', '.join(failed_checks)}")
