"""The report of a check as text and as escaped HTML, criterion by criterion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape

from robomark_notebook.engine import Check, CheckedCriterion


def format_check(check: Check) -> str:
    """Return the report as text."""
    return "\n".join(_iterate_lines(check))


def _iterate_lines(check: Check) -> Iterator[str]:
    yield f"{check.title}: {check.marks} of {check.out_of} marks. {check.happened}"
    for criterion in check.criteria:
        yield f"{_sign(criterion)} {criterion.title}: {criterion.marks} / {criterion.out_of}"
        if criterion.found:
            yield f"  {criterion.found}"
    yield from (f"Next: {step}" for step in check.next_steps)
    yield from (f"Note: {note}" for note in check.notes)


def format_check_as_html(check: Check) -> str:
    """Return the report as HTML. Its hidden buttons open moments of the replay where there is one.

    Saved notebooks show it without the widget's style sheet, so the table's cells have their own alignment.
    """
    rows = "".join(_build_row(criterion, _build_watch_button(check, criterion)) for criterion in check.criteria)
    steps = "".join(f"<p><b>Next:</b> {escape(step)}</p>" for step in check.next_steps)
    notes = "".join(f'<p class="soft small">Note: {escape(note)}</p>' for note in check.notes)
    return (
        f'<div class="check"><h3>{escape(check.title)}</h3>'
        f'<p class="score"><b>{escape(check.marks)}</b> of {escape(check.out_of)} marks</p>'
        f"<p>{escape(check.happened)}</p>{steps}"
        '<table><thead><tr><th scope="col" style="text-align: left">Criterion</th>'
        '<th scope="col" class="number">Marks</th></tr></thead>'
        f"<tbody>{rows}</tbody></table>{notes}</div>"
    )


def _build_row(criterion: CheckedCriterion, watch_button: str) -> str:
    state = "full" if criterion.passed else "none"
    found = f"<p>{escape(criterion.found)}</p>" if criterion.found else ""
    return (
        f'<tr class="{state}"><th scope="row" style="text-align: left; font-weight: normal">'
        f'<span class="sign">{_sign(criterion)}</span> <b>{escape(criterion.title)}</b>{watch_button}{found}</th>'
        f'<td class="number">{escape(criterion.marks)} / {escape(criterion.out_of)}</td></tr>'
    )


def _build_watch_button(check: Check, criterion: CheckedCriterion) -> str:
    if criterion.moment is None or check.replay is None:
        return ""
    index, seconds = criterion.moment
    # Rounding never makes it earlier.
    moment = f"#trial={int(check.replay['trials'][index]['trial'])}&t={math.ceil(seconds * 1000 - 1e-6) / 1000:.3f}"
    return (
        f' <button type="button" class="watch" data-moment="{escape(moment)}" hidden>Watch at {seconds:.1f} s</button>'
    )


def _sign(criterion: CheckedCriterion) -> str:
    return "✓" if criterion.passed else "✗"
