"""The moderation sheet of one assignment in one batch, for external examiners: a page to print or to send.

The caller has replaced hidden names by labels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Decimal

from service.grading.class_statistics import AssignmentStatistics, Cause, MarksBin
from service.grading.task_quality import Interval, TaskQuality
from service.language import ENGLISH, Language, translatable
from service.moderation_records import SheetAppeal, SheetLogHead, SheetOverride, SheetVersion
from service.reports.display_text import format_decimal
from service.reports.html import render_page
from service.reports.verdict_sentences import describe_verdict
from sim.recording import Verdict
from submissions.assignment.definition import Assignment

_MAX_CAUSES = 8
#: The digits of a checksum that identify it on paper.
_SHORT_HASH = 16
_VISIBILITIES = {
    "visible": translatable("yes"),
    "hidden": translatable("no"),
    "after_due_date": translatable("after the deadline"),
    "after_published": translatable("after publication"),
}


@dataclass(frozen=True, slots=True)
class SheetMarks:
    """The marks of one student; None if there is no grade, with the reason in ``note``."""

    student: str
    attempt: int
    marks: Decimal | None
    max_marks: Decimal
    verdict: str | None
    published_at: datetime | None
    is_provisional: bool  # the marks depend on a pool of which not all trials were run
    adjusted: int  # criteria that staff adjusted
    unjudged: int  # criteria that could not be judged
    note: str = ""


@dataclass(frozen=True, slots=True)
class ModerationSheet:
    """The content of a sheet. Statistics and quality are None without a grade."""

    course: str
    batch: str
    batch_id: str
    created_at: datetime
    written_at: datetime
    assignment: Assignment
    has_hidden_names: bool
    statistics: AssignmentStatistics | None
    quality: TaskQuality | None
    distribution: tuple[MarksBin, ...]
    marks: tuple[SheetMarks, ...]
    overrides: tuple[SheetOverride, ...]
    appeals: tuple[SheetAppeal, ...]
    versions: tuple[SheetVersion, ...]
    log_head: SheetLogHead | None


def render_moderation_sheet(sheet: ModerationSheet, language: Language = ENGLISH) -> str:
    """Return the sheet as a self-contained HTML page."""
    return render_page(
        "moderation.html",
        language_of_page=language,
        styles=("report.css", "moderation.css"),
        sheet=sheet,
        paragraphs=[each.strip() for each in sheet.assignment.description.split("\n\n") if each.strip()],
        visibilities={name: language.say(text) for name, text in _VISIBILITIES.items()},
        causes=_describe_causes(sheet.statistics, language),
        findings=[] if sheet.quality is None else _describe_findings(sheet.quality, language),
        note="" if sheet.quality is None else language.translate_sentence(sheet.quality.note),
        statuses=[_describe_status(each, language) for each in sheet.marks],
        verdicts={each.value: describe_verdict(each, language).short for each in Verdict},
        moment=_format_moment,
        marks=_format_marks,
        short_hash=lambda digest: digest[:_SHORT_HASH],
        per_cent=_format_share,
        correlation=_format_correlation,
    )


def _describe_causes(statistics: AssignmentStatistics | None, language: Language) -> list[tuple[str, int]]:
    causes: Sequence[Cause] = () if statistics is None else statistics.causes[:_MAX_CAUSES]
    return [
        (
            language.translate_sentence(cause.sentence) if cause.criterion else language.say(cause.sentence),
            len(cause.students),
        )
        for cause in causes
    ]


def _describe_findings(quality: TaskQuality, language: Language) -> list[str]:
    return [language.translate_sentence(finding.sentence) for finding in quality.findings]


def _describe_status(marks: SheetMarks, language: Language) -> str:
    """Return what a reader has to know about the marks of a student."""
    if marks.marks is None:
        return marks.note
    parts = [language.say("provisional") if marks.is_provisional else ""]
    if marks.adjusted:
        parts.append(language.say("adjusted by staff"))
    if marks.unjudged:
        parts.append(
            language.counted("%(count)s criterion not judged", "%(count)s criteria not judged", marks.unjudged)
        )
    if marks.note:
        parts.append(marks.note)
    parts.append(language.say("not published") if marks.published_at is None else language.say("published"))
    return ", ".join(part for part in parts if part)


def _format_moment(moment: datetime | None) -> str:
    """Return a time for a page that is read in other places, too."""
    return "–" if moment is None else f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC"


def _format_marks(marks: Decimal | None) -> str:
    return "–" if marks is None else format_decimal(marks)


def _format_share(value: float | None, interval: Interval | None = None) -> str:
    if value is None:
        return "–"
    return f"{100 * value:.0f} %" + (f" ({100 * interval.low:.0f} – {100 * interval.high:.0f})" if interval else "")


def _format_correlation(value: float | None, interval: Interval | None) -> str:
    if value is None or interval is None:
        return "–"
    return f"{value:.2f} ({interval.low:.2f} – {interval.high:.2f})"
