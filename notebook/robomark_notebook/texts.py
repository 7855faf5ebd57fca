"""The results of runs as text and as escaped HTML. Student text is shown and never run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

from robomark_notebook.engine import RobotRun, RunFault

#: The most lines of one run that are shown. The replay has all of them.
_MAX_LINES = 200
_MAX_LENGTH = 600
_ERROR = "border-left: 4px solid #c43145; padding-left: 0.8em; margin: 0.4em 0"
_NOTE = "opacity: 0.75; margin: 0.3em 0"


def summarize_run(run: RobotRun) -> str:
    """Return the sentence for viewers that cannot play the replay."""
    return f"Robot run of {run.seconds:.2f} s: {run.happened} (recording {run.sha256[:12]})"


def format_run(run: RobotRun, notes: Sequence[str], faults: Sequence[RunFault]) -> str:
    """Return what was printed, said and sent, then the faults and notes, as text."""
    shown, left_out = _select_lines(run)
    lines = [f"{seconds:7.2f} s  {text}" for seconds, text in shown]
    return "\n".join([*lines, *left_out, *map(_describe_fault, faults), *format_notes(notes)])


def format_run_as_html(run: RobotRun, notes: Sequence[str], faults: Sequence[RunFault]) -> str:
    """Return the same as HTML."""
    shown, left_out = _select_lines(run)
    printed = "\n".join(f"{seconds:7.2f} s  {escape(text)}" for seconds, text in shown)
    parts = [f"<pre>{printed}</pre>"] if shown else []
    parts += [_to_paragraph(text, _NOTE) for text in left_out]
    parts += [_to_paragraph(_describe_fault(fault), _ERROR) for fault in faults]
    parts += [_to_paragraph(text, _NOTE) for text in format_notes(notes)]
    return "".join(parts)


def format_notes(notes: Iterable[str]) -> list[str]:
    """Return the sentences of notes."""
    return [f"Note: {note}" for note in notes]


def format_notes_as_html(notes: Iterable[str]) -> str:
    """Return the same as HTML."""
    return "".join(_to_paragraph(note, _NOTE) for note in format_notes(notes))


def _select_lines(run: RobotRun) -> tuple[list[tuple[float, str]], list[str]]:
    """Return the lines that are shown, and a sentence on the others if there are any."""
    shown = [(seconds, text if len(text) <= _MAX_LENGTH else f"{text[:_MAX_LENGTH]} …") for seconds, text in run.lines]
    more = len(shown) - _MAX_LINES
    return shown[:_MAX_LINES], [f"… {more} more lines are in the replay"] if more > 0 else []


def _describe_fault(fault: RunFault) -> str:
    place = f"{fault.place}: " if fault.place else ""
    return f"{place}{fault.message}" + (f"\n{fault.hint}" if fault.hint else "")


def _to_paragraph(text: str, style: str) -> str:
    lines = "<br>".join(escape(line) for line in text.split("\n"))
    return f'<p style="{style}">{lines}</p>'
