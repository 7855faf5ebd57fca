"""Similar submissions of a batch, for staff: as table rows, as JSON, and as a page with the evidence side by side.

The similarities were found before, and ``view.py`` decides who may see them. Student text is shown and never run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import zip_longest
from types import MappingProxyType
from typing import Any

from markupsafe import Markup

from service.language import ENGLISH, Language, translatable
from service.reports.display_text import to_one_line
from service.reports.html import render_page, render_part
from service.reports.view import SimilarityView
from service.similarity.behaviour import Aspect, SharedBehaviour
from service.similarity.pairs import Similarity, SimilarPair
from service.similarity.similar_sources import MIN_TOKENS, SimilarSources, Stretch

#: The aspects in which two students' trials can be the same.
_ASPECTS: Mapping[Aspect, str] = MappingProxyType(
    {"path": translatable("path"), "messages": translatable("messages"), "faults": translatable("faults")}
)
#: Returns the text of a source by assignment, student and file.
SourceReader = Callable[[str, str, str], str]

#: Limits of a pair's stretches, of a stretch's lines, and of a line's characters.
_MAX_STRETCHES, _MAX_LINES, _MAX_LINE_LENGTH = 12, 60, 160


def describe_similarity(similarity: Similarity, language: Language = ENGLISH) -> str:
    """Return a sentence on an assignment: the number of pairs, and what could not be compared."""
    parts: dict[str, object] = {"assignment": similarity.assignment, "students": similarity.students}
    groups = len({*similarity.same, *similarity.same_recordings})
    sentence = language.say("%(assignment)s: no similar pairs among %(students)s students", **parts)
    if groups:
        sentence = language.counted(
            "%(assignment)s: %(count)s group with a common file or common recordings among %(students)s students",
            "%(assignment)s: %(count)s groups with a common file or common recordings among %(students)s students",
            groups,
            **parts,
        )
    if similarity.pairs:
        sentence = language.counted(
            "%(assignment)s: %(count)s similar pair among %(students)s students",
            "%(assignment)s: %(count)s similar pairs among %(students)s students",
            len(similarity.pairs),
            **parts,
        )
    if similarity.too_short:
        sentence += "; " + language.counted(
            "%(count)s student has too little code to compare (fewer than %(tokens)s tokens), so only the recordings "
            "are compared",
            "%(count)s students have too little code to compare (fewer than %(tokens)s tokens), so only the "
            "recordings are compared",
            len(similarity.too_short),
            tokens=MIN_TOKENS,
        )
    if similarity.not_compared:
        sentence += "; " + language.counted(
            "%(count)s less similar pair was not compared",
            "%(count)s less similar pairs were not compared",
            similarity.not_compared,
        )
    return sentence


def build_similarity_rows(similarity: Similarity, language: Language = ENGLISH) -> list[tuple[str, ...]]:
    """Return rows with both students, the similar fraction of a source, its place, and the trials in common."""
    return [
        (
            *pair.students,
            f"{pair.share:.0%}" if pair.sources else "",
            _format_files(pair, language),
            _format_trial_count(pair, language),
        )
        for pair in similarity.pairs
    ]


def similarity_to_json(view: SimilarityView) -> list[dict[str, Any]]:
    """Return all findings by assignment, as plain JSON values."""
    return [
        {**asdict(found), "pairs": [{**asdict(pair), "share": pair.share} for pair in found.pairs]}
        for found in view.found
    ]


def render_similarity_page(view: SimilarityView, texts: SourceReader, title: str, max_pairs: int) -> str:
    """Return a page with the first ``max_pairs`` pairs of each assignment."""
    return render_page("similarity.html", title=title, assignments=_build_assignments(view, texts, max_pairs), links={})


def render_similarity_body(
    view: SimilarityView, texts: SourceReader, max_pairs: int, links: Mapping[tuple[str, str], str]
) -> Markup:
    """Return the findings as a part of another page, with ``links`` by assignment and student."""
    return render_part(
        "similarity_body.html", view.language, assignments=_build_assignments(view, texts, max_pairs), links=links
    )


def _build_assignments(view: SimilarityView, texts: SourceReader, max_pairs: int) -> list[dict[str, object]]:
    return [
        {
            "name": found.assignment,
            "words": describe_similarity(found, view.language),
            "same": found.same,
            "same_recordings": found.same_recordings,
            "rows": build_similarity_rows(found, view.language)[:max_pairs],
            "more": len(found.pairs) - max_pairs,
            "pairs": [_build_pair(found.assignment, pair, texts, view.language) for pair in found.pairs[:max_pairs]],
        }
        for found in view.found
    ]


def _format_files(pair: SimilarPair, language: Language) -> str:
    return "; ".join(language.say(" and ").join(dict.fromkeys(each.files)) for each in pair.sources)


def _format_trial_count(pair: SimilarPair, language: Language) -> str:
    trials = {same.trial for same in pair.trials}
    return language.counted("%(count)s trial", "%(count)s trials", len(trials)) if trials else ""


def _build_pair(assignment: str, pair: SimilarPair, texts: SourceReader, language: Language) -> dict[str, object]:
    return {
        "students": pair.students,
        "sources": [_build_source(assignment, each, texts, language) for each in pair.sources],
        "trials": [_format_trial(same, language) for same in pair.trials],
    }


def _build_source(
    assignment: str, similar_sources: SimilarSources, texts: SourceReader, language: Language
) -> dict[str, object]:
    line_lists = [
        texts(assignment, student, file).split("\n")
        for student, file in zip(similar_sources.students, similar_sources.files, strict=True)
    ]
    headings = [
        language.say(
            "%(student)s: %(file)s, %(share)s of %(tokens)s tokens",
            student=student,
            file=file,
            share=f"{share:.0%}",
            tokens=own,
        )
        for student, file, share, own in zip(
            similar_sources.students,
            similar_sources.files,
            similar_sources.shares,
            similar_sources.own_tokens,
            strict=True,
        )
    ]
    sorted_stretches = sorted(similar_sources.stretches[:_MAX_STRETCHES], key=lambda stretch: stretch.lines)
    return {
        "heads": headings,
        "stretches": [list(_align_lines(stretch, *line_lists)) for stretch in sorted_stretches],
        "more": len(similar_sources.stretches) - _MAX_STRETCHES,
    }


def _align_lines(
    stretch: Stretch, first_lines: Sequence[str], second_lines: Sequence[str]
) -> Iterator[tuple[str, str, str, str]]:
    sides = (_number_lines(first_lines, stretch.lines), _number_lines(second_lines, stretch.other_lines))
    for left, right in zip_longest(*sides, fillvalue=("", "")):
        yield *left, *right


def _number_lines(lines: Sequence[str], span: tuple[int, int]) -> list[tuple[str, str]]:
    first_number, last_number = span
    numbered_lines = [
        (str(number), "    " * _measure_indentation(text) + to_one_line(text, _MAX_LINE_LENGTH))
        for number, text in enumerate(lines[first_number - 1 : last_number][:_MAX_LINES], first_number)
    ]
    return numbered_lines if last_number - first_number < _MAX_LINES else [*numbered_lines, ("", "…")]


def _measure_indentation(line: str) -> int:
    """Return how far a line is indented, in steps of four."""
    start = line[: 4 * 10].expandtabs(4)
    return (len(start) - len(start.lstrip())) // 4


def _format_trial(shared_behaviour: SharedBehaviour, language: Language) -> tuple[str, ...]:
    say = language.say
    noise_text = say("with noise") if shared_behaviour.trial.noisy else say("without noise")
    sharing_text = say(
        "%(sharing)s of %(students)s", sharing=shared_behaviour.sharing, students=shared_behaviour.students
    )
    return (
        f"{shared_behaviour.trial.scenario} {shared_behaviour.trial.index + 1}",
        noise_text,
        say(_ASPECTS[shared_behaviour.aspect]),
        sharing_text,
    )
