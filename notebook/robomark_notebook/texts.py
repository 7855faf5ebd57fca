"""The results of runs as text and as escaped HTML. Student text is shown and never run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from robomark_notebook.engine import RobotRun, RunFault

#: The most lines of one run that are shown, from its start and before its end. The replay has all of them.
_FIRST_LINES, _LAST_LINES = 60, 40
_MAX_LENGTH = 600
_LINES = "max-height: 20em; overflow: auto"
_ERROR = "border-left: 4px solid #c43145; padding-left: 0.8em; margin: 0.4em 0"
_NOTE = "opacity: 0.75; margin: 0.3em 0"


def summarize_run(run: RobotRun) -> str:
    """Return the sentence for viewers that cannot play the replay."""
    return f"Robot run of {run.seconds:.2f} s: {run.happened} (recording {run.sha256[:12]})"


def format_run(run: RobotRun, notes: Sequence[str], faults: Sequence[RunFault]) -> str:
    """Return what was printed, said and sent, then the faults and notes, as text."""
    return "\n".join([*_format_lines(run), *map(_describe_fault, faults), *format_notes(notes)])


def format_run_as_html(run: RobotRun, notes: Sequence[str], faults: Sequence[RunFault]) -> str:
    """Return the same as HTML."""
    lines = escape("\n".join(_format_lines(run)))
    parts = [f'<pre style="{_LINES}">{lines}</pre>'] if lines else []
    parts += [_to_paragraph(_describe_fault(fault), _ERROR) for fault in faults]
    parts += [_to_paragraph(text, _NOTE) for text in format_notes(notes)]
    return "".join(parts)


def format_notes(notes: Iterable[str]) -> list[str]:
    """Return the sentences of notes."""
    return [f"Note: {note}" for note in notes]


def format_notes_as_html(notes: Iterable[str]) -> str:
    """Return the same as HTML."""
    return "".join(_to_paragraph(note, _NOTE) for note in format_notes(notes))


def _format_lines(run: RobotRun) -> list[str]:
    """Return the lines with their times. Long texts are cut, and of many lines some in the middle are left out."""
    lines = [f"{seconds:7.2f} s  {_shorten(text)}" for seconds, text in run.lines]
    left_out = len(lines) - _FIRST_LINES - _LAST_LINES
    if left_out <= 0:
        return lines
    return [*lines[:_FIRST_LINES], f"… {left_out} more lines, which are in the replay …", *lines[-_LAST_LINES:]]


def _shorten(text: str) -> str:
    return text if len(text) <= _MAX_LENGTH else f"{text[:_MAX_LENGTH]} …"


def _describe_fault(fault: RunFault) -> str:
    place = f"{fault.place}: " if fault.place else ""
    return f"{place}{fault.message}" + (f"\n{fault.hint}" if fault.hint else "")


def _to_paragraph(text: str, style: str) -> str:
    lines = "<br>".join(escape(line) for line in text.split("\n"))
    return f'<p style="{style}">{lines}</p>'
