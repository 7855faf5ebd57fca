"""``robomark grade --nearest``: the smallest change of a number with which lost criteria pass, for staff."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from service.grading.grade import Grade
from service.grading.number_experiments import GradedCriterion
from service.grading.number_search import NumberSearch, find_nearest_number
from service.grading.pools.drawing import PoolExtent
from service.grading.trial_runner import TrialRunner
from service.reports.display_text import format_decimal, to_json_number, to_one_line
from service.reports.formats.json_output import build_json_document
from service.reports.view import build_staff_view
from submissions.assignment.definition import Assignment
from submissions.seeds import SeedSource
from submissions.submission import Submission

#: Criteria beyond these are not searched. Those that lost most come first.
_MAX_CRITERIA = 3


def search_lost_criteria(
    submission: Submission,
    assignment: Assignment,
    grade: Grade,
    runner: TrialRunner,
    secret: SeedSource,
    extent: PoolExtent,
) -> tuple[NumberSearch, ...]:
    """Return the search for each of the costliest criteria, until a change gives full marks for everything."""
    lost = sorted(
        (each for each in grade.criteria if each.marks < each.max_marks and not each.unjudged),
        key=lambda each: each.marks - each.max_marks,
    )
    criteria = {each.id: each for each in assignment.criteria}
    searches: list[NumberSearch] = []
    for result in lost[:_MAX_CRITERIA]:
        case = GradedCriterion(submission, assignment, grade, criteria[result.id], runner, secret, extent)
        searches.append(find_nearest_number(case))
        change = searches[-1].change
        if change is not None and change.marks >= grade.max_marks:
            break
    return tuple(searches)


def print_nearest(grade: Grade, searches: Sequence[NumberSearch]) -> None:
    """Print a paragraph for each search below the grade."""
    titles = {each.id: to_one_line(each.title) for each in grade.criteria}
    for search in searches:
        change = search.change
        print()
        print(f"Nearest change for {titles[search.criterion]!r} ({search.runs} runs):")
        if change is None:
            reason = "within the limit of runs and CPU time" if search.is_exhausted else "in this program"
            print(f"  no change of one number passes {reason}")
        else:
            marks = f"{format_decimal(change.marks)} of {format_decimal(grade.max_marks)} marks"
            print(
                f"  line {change.line} of {change.file}: {change.old} -> {change.new} ({change.distance:.1%}), {marks}"
            )
            print(f"  For the student: {search.direction}")


def print_json_with_nearest(grade: Grade, submission: Submission, searches: Sequence[NumberSearch]) -> None:
    """Print the JSON document of the grade, with the searches under ``nearest``."""
    document = build_json_document(build_staff_view(grade), submission)
    document["nearest"] = list(map(_search_to_json, searches))
    print(json.dumps(document, indent=2, allow_nan=False))


def _search_to_json(search: NumberSearch) -> dict[str, Any]:
    values: dict[str, Any] = {"criterion": search.criterion, "runs": search.runs, "exhausted": search.is_exhausted}
    change = search.change
    if change is not None:
        values |= {
            "file": change.file,
            "line": change.line,
            "column": change.column,
            "old": change.old,
            "new": change.new,
            "distance": change.distance,
            "role": change.role,
            "direction": change.direction,
            "sentence": str(search.direction),
            "marks": to_json_number(change.marks),
        }
    return values
