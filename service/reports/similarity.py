"""What is alike in a batch, told to staff: as rows of a table, as JSON, and as a page with the evidence side by side.

What is alike was decided before; who may see it is ``view.py``'s. What students wrote is shown as text and never run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from itertools import zip_longest
from typing import Any

from service.reports.html import render
from service.reports.readable import one_line
from service.reports.view import SimilarityView
from service.similarity.behaviour import SameInTrial
from service.similarity.pairs import Similarity, SimilarPair
from service.similarity.writing import FEWEST_TOKENS, AlikeSources, Stretch

#: Gives the text of a source by assignment, student and file.
Texts = Callable[[str, str, str], str]

#: Of a pair's sources; of a stretch; and of a line.
_MOST_STRETCHES, _MOST_LINES, _MOST_OF_LINE = 12, 60, 160


def what_it_says(found: Similarity) -> str:
    """One sentence on an assignment: how many pairs, and of what nothing can be said."""
    pairs = "1 pair is" if len(found.pairs) == 1 else f"{len(found.pairs) or 'no'} pairs are"
    said = f"{found.assignment}: {pairs} alike among {found.students} students"
    if found.too_short:
        who = "1 has" if len(found.too_short) == 1 else f"{len(found.too_short)} have"
        said += f"; {who} too little code of their own to compare (under {FEWEST_TOKENS} tokens)"
    if found.not_compared:
        said += f"; {found.not_compared} pairs that have less in common were too many to compare"
    return said


def similarity_rows(found: Similarity) -> list[tuple[str, ...]]:
    """Both students, how much of a source is alike, where, and in how many trials both did the same."""
    return [
        (*pair.students, f"{pair.share:.0%}" if pair.sources else "", _where(pair), _same(pair)) for pair in found.pairs
    ]


def as_plain(view: SimilarityView) -> list[dict[str, Any]]:
    """Everything that was found, an assignment each, as JSON has it."""
    return [
        {**asdict(found), "pairs": [{**asdict(pair), "share": pair.share} for pair in found.pairs]}
        for found in view.found
    ]


def similarity_page(view: SimilarityView, texts: Texts, title: str, most: int) -> str:
    """A page with the first ``most`` pairs of each assignment."""
    assignments = [
        {
            "words": what_it_says(found),
            "rows": similarity_rows(found)[:most],
            "more": len(found.pairs) - most,
            "pairs": [_pair(found.assignment, pair, texts) for pair in found.pairs[:most]],
        }
        for found in view.found
    ]
    return render("similarity.html", title=title, assignments=assignments)


def _where(pair: SimilarPair) -> str:
    return "; ".join(" and ".join(dict.fromkeys(each.files)) for each in pair.sources)


def _same(pair: SimilarPair) -> str:
    trials = {same.trial for same in pair.trials}
    return "" if not trials else "1 trial" if len(trials) == 1 else f"{len(trials)} trials"


def _pair(assignment: str, pair: SimilarPair, texts: Texts) -> dict[str, object]:
    return {
        "students": pair.students,
        "sources": [_source(assignment, each, texts) for each in pair.sources],
        "trials": [_trial(same) for same in pair.trials],
    }


def _source(assignment: str, alike: AlikeSources, texts: Texts) -> dict[str, object]:
    both = [
        texts(assignment, student, file).split("\n") for student, file in zip(alike.students, alike.files, strict=True)
    ]
    heads = [
        f"{student}: {file}, {share:.0%} of {own} tokens"
        for student, file, share, own in zip(alike.students, alike.files, alike.shares, alike.own_tokens, strict=True)
    ]
    in_order = sorted(alike.stretches[:_MOST_STRETCHES], key=lambda stretch: stretch.lines)
    return {
        "heads": heads,
        "stretches": [list(_side_by_side(stretch, *both)) for stretch in in_order],
        "more": len(alike.stretches) - _MOST_STRETCHES,
    }


def _side_by_side(stretch: Stretch, one: Sequence[str], other: Sequence[str]) -> Iterator[tuple[str, str, str, str]]:
    sides = (_numbered(one, stretch.lines), _numbered(other, stretch.other_lines))
    for left, right in zip_longest(*sides, fillvalue=("", "")):
        yield *left, *right


def _numbered(lines: Sequence[str], span: tuple[int, int]) -> list[tuple[str, str]]:
    first, last = span
    shown = [
        (str(number), "    " * _depth(text) + one_line(text, _MOST_OF_LINE))
        for number, text in enumerate(lines[first - 1 : last][:_MOST_LINES], first)
    ]
    return shown if last - first < _MOST_LINES else [*shown, ("", "…")]


def _depth(line: str) -> int:
    """How far a line is indented, in steps of four."""
    start = line[: 4 * 10].expandtabs(4)
    return (len(start) - len(start.lstrip())) // 4


def _trial(same: SameInTrial) -> tuple[str, ...]:
    chance = "with noise" if same.trial.noisy else "without noise"
    return (f"{same.trial.scenario} {same.trial.index + 1}", chance, same.aspect, f"{same.sharing} of {same.students}")
