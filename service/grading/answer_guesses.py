"""What a submission without effort can answer: one constant for everything, or everything at once.

The answers come from the criteria of an assignment, as a student might copy them from its description. ``no_effort.py``
makes submissions of them.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sim.floors import list_label_names
from submissions.assignment.definition import Assignment
from submissions.criteria import Criterion
from submissions.criteria.code import Functions
from submissions.criteria.recognition import Recognition
from submissions.criteria.replies import Replies, list_allowed_answers
from submissions.criteria.reporting import Events, Reports
from submissions.criteria.sequence import WordSequence
from submissions.criteria.texts import Messages, TextSequence

#: The constant text if no criterion expects a text.
_ANY_TEXT = "Hello"
Answers = tuple[Any, ...]


@dataclass(frozen=True, slots=True)
class Guesses:
    """The possible answers, the most frequent first.

    ``outputs`` has the texts of each criterion about the robot's output, and ``messages`` the texts to send.
    ``replies`` has, for each criterion about the responder, the place in the JSON (empty for the whole text) and the
    answers. ``results`` has the results of each function.
    """

    outputs: tuple[tuple[str, ...], ...]
    messages: tuple[str, ...]
    replies: tuple[tuple[str, Answers], ...]
    results: Mapping[str, Answers]

    @property
    def constant_text(self) -> str:
        """One text with the most frequent answer for each criterion."""
        return " ".join(dict.fromkeys(texts[0] for texts in self.outputs)) or _ANY_TEXT

    @property
    def all_texts(self) -> tuple[str, ...]:
        """Every answer for every criterion."""
        return tuple(dict.fromkeys(text for texts in self.outputs for text in texts)) or (_ANY_TEXT,)

    @property
    def constant_reply(self) -> str:
        """One reply with the most frequent answer for each criterion."""
        return self._build_reply(lambda answers: answers[:1])

    @property
    def complete_reply(self) -> str:
        """One reply with every answer for every criterion."""
        return self._build_reply(lambda answers: answers)

    @property
    def single_replies(self) -> tuple[str, ...]:
        """Replies that each have one answer for each criterion. Together, they have all answers."""
        count = max((len(answers) for _, answers in self.replies), default=1)
        return tuple(self._build_reply(lambda answers: (answers[each % len(answers)],)) for each in range(count))  # noqa: B023 - called at once

    def _build_reply(self, choose: Callable[[Answers], Answers]) -> str:
        chosen_answers: dict[str, list[Any]] = {}
        for place, answers in self.replies:
            chosen_answers.setdefault(place, []).extend(choose(answers))
        return build_reply({place: _join_answers(answers) for place, answers in chosen_answers.items()})


def collect_guesses(assignment: Assignment) -> Guesses:
    """Return the answers that the criteria of the assignment expect. Criteria without marks do not count."""
    outputs: list[Iterable[str]] = []
    messages: list[str] = []
    replies: list[tuple[str, Iterable[Any]]] = []
    results: dict[str, list[Any]] = {}
    for criterion in filter(lambda each: each.marks, assignment.criteria):
        match criterion:
            case Functions():
                for name, result in _list_results(criterion):
                    results.setdefault(name, []).append(result)
            case Messages():
                messages += _list_sequence_texts(criterion)
            case Replies():
                replies.append((criterion.path or "", _list_reply_answers(criterion)))
            case Recognition() if criterion.answer_from == "reply":
                replies.append((criterion.answer or "", _list_labels(assignment, criterion)))
            case Reports() if criterion.source == "reply":
                replies.append(("message", _list_rows(assignment, criterion)))
            case _:
                outputs.append(_list_outputs(assignment, criterion))
    sorted_replies = ((place, _sort_by_frequency(answers)) for place, answers in replies)
    return Guesses(
        tuple(filter(None, map(_sort_by_frequency, outputs))),
        tuple(dict.fromkeys(messages)),
        tuple((place, answers) for place, answers in sorted_replies if answers),
        {name: _sort_by_frequency(answers) for name, answers in results.items()},
    )


def build_reply(answers: Mapping[str, Any]) -> str:
    """Return a reply with an answer at each place: as JSON, unless there is none but the whole text."""
    document: dict[str, Any] = {}
    for place, answer in sorted(answers.items()):
        *parents, name = place.split(".")
        table = document
        for parent in parents:
            if not isinstance(table.get(parent), dict):
                table[parent] = {}
            table = table[parent]
        table[name] = answer
    whole_text = document.pop("", "")
    return "JSON::" + json.dumps(document) if document else _to_text(whole_text)


def _list_outputs(assignment: Assignment, criterion: Criterion) -> Iterable[str]:
    """Return the texts that a criterion about the robot's output expects; empty for other criteria."""
    match criterion:
        case Reports():
            return _list_rows(assignment, criterion)
        case Recognition():
            return _list_labels(assignment, criterion)
        case Events():
            return [event.text[0] for event in criterion.events]
        case WordSequence():
            return [" ".join(alternatives[0] for alternatives in criterion.words)]
        case TextSequence():
            return _list_sequence_texts(criterion)
        case _:
            return ()


def _list_results(criterion: Functions) -> Iterator[tuple[str, Any]]:
    """Yield the name of the function and the result of each call."""
    for call in criterion.calls:
        result = call.one_of[0] if call.one_of else call.returns
        yield (
            call.function or criterion.function,
            result if criterion.path is None else build_reply({criterion.path: result}),
        )


def _list_rows(assignment: Assignment, criterion: Reports) -> Sequence[str]:
    if criterion.expected == "label":
        return list_label_names(assignment.world.background)
    return [" ".join(map(_to_text, row)) for row in criterion.expected]


def _list_labels(assignment: Assignment, criterion: Recognition) -> Sequence[str]:
    if isinstance(criterion.truth, tuple):
        return criterion.truth
    return criterion.labels or list_label_names(assignment.world.background)


def _list_sequence_texts(criterion: TextSequence) -> Sequence[str]:
    start, *_ = criterion.starts_with or ("",)
    texts = (*criterion.equals, *criterion.in_order, *criterion.among) or ("",)
    return [_join_answers([start, *criterion.contains, text]) for text in texts if start or criterion.contains or text]


def _list_reply_answers(criterion: Replies) -> Iterator[Any]:
    for expected in criterion.expect.values():
        yield list_allowed_answers(expected)[0]
    yield from (*criterion.equals, *criterion.in_order)
    if criterion.value is not None:
        yield criterion.value
    if criterion.contains:
        yield " ".join(criterion.contains)


def _sort_by_frequency(answers: Iterable[Any]) -> Answers:
    """Return the different answers, the most frequent first; equally frequent ones in their order."""
    answers_by_text: dict[str, Any] = {}
    counts: Counter[str] = Counter()
    for answer in answers:
        answers_by_text.setdefault(_to_text(answer), answer)
        counts[_to_text(answer)] += 1
    return tuple(answers_by_text[text] for text, _ in counts.most_common())


def _join_answers(answers: Sequence[Any]) -> Any:
    """Return the different answers in one text; a single answer as it is."""
    texts = {_to_text(answer): answer for answer in answers if answer != ""}
    return next(iter(texts.values())) if len(texts) == 1 else " ".join(texts)


def _to_text(answer: Any) -> str:
    if isinstance(answer, float):
        return f"{answer:g}"
    return answer if isinstance(answer, str) else json.dumps(answer)
