"""Hints on misclassified images: names in another order, one answer for all, the wrong sensor's image.

They use the confusion matrix of the trials that the student may see.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from service.grading.findings import UnnamedLabel
from service.grading.grade import Accuracy, CriterionResult
from service.grading.hint_clues import Clues, find_finding
from service.grading.hint_code import CallInCode, join_tokens
from service.grading.judging.message_parts import quote_text

_RIGHT = re.compile(r"""["']right["']|\bright(?:_\w*)?im(?:g|age)\w*|\bright_\w+""")
_LEFT = re.compile(r"""["']left["']|\bleft(?:_\w*)?im(?:g|age)\w*|\bleft_\w+""")
_DIVISION = re.compile(r"/\s*\(?\s*(?:max|255|\w+\.max|np\.|\w+)")
_PREDICT_CALL = re.compile(r"\.predict\w*\(|class_predict")
_MAX_ACCURACY = 0.5


def hint_about_recognition(clues: Clues) -> Iterator[str]:
    """Yield a hint for the first criterion that lost marks on images."""
    for result in (*clues.results, *(clues.practice if clues.lost else ())):
        accuracy = result.accuracy
        if accuracy is None or accuracy.value > _MAX_ACCURACY + 0.2 or not accuracy.n:
            continue
        answers = {truth: answer for truth, answer, _ in accuracy.confusion if answer is not None}
        if accuracy.value <= _MAX_ACCURACY and answers:
            hint = (
                _hint_about_other_sensor(clues)
                or _hint_about_label_order(answers, clues)
                or _hint_about_constant_answer(answers, accuracy, clues)
            )
        else:
            hint = _hint_about_label_order(answers, clues)
        hint = (
            hint or _hint_about_unknown_label(result, accuracy, clues) or _hint_about_frequent_answer(accuracy, clues)
        )
        if hint:
            yield hint
            return


def _hint_about_other_sensor(clues: Clues) -> str:
    """Return a hint on the line that uses the right sensor's image, if no line uses the left one's."""
    for listing in clues.responders:
        line = listing.find_line(_RIGHT)
        if line is not None and not any(each.find_line(_LEFT) for each in clues.responders):
            return (
                f"{listing.locate(line)} uses the right sensor's image, but the picture lies under the left sensor. "
                f"Write left in place of right"
            )
    return ""


def _hint_about_label_order(answers: Mapping[str, str], clues: Clues) -> str:
    """Return a hint on class names in a different order than the network's: two swapped, or all shifted."""
    swapped_pairs = [
        (truth, answer) for truth, answer in answers.items() if truth != answer and answers.get(answer) == truth
    ]
    wrong_truths = [truth for truth, answer in answers.items() if truth != answer]
    if not wrong_truths or len(set(answers.values())) < len(answers):
        return ""
    location = _describe_labels_line(wrong_truths, clues)
    if len(swapped_pairs) == len(wrong_truths) == 2:
        first_name, second_name = swapped_pairs[0]
        order = "Put the names into the order of the network" if _has_prediction(clues) else "Exchange the two names"
        return f"{location}: {quote_text(first_name)} and {quote_text(second_name)} are swapped. {order}"
    if len(wrong_truths) == len(answers) > 2:
        return (
            f"{location}: every image gets another's name, so the names are shifted by one place or in another order: "
            f"{quote_text(wrong_truths[0])} is called {quote_text(answers[wrong_truths[0]])}. Put the names into the "
            "order of the network, and count from 0"
        )
    if len(wrong_truths) > 2:
        return (
            f"{location}: the names are in another order: {quote_text(wrong_truths[0])} is called "
            f"{quote_text(answers[wrong_truths[0]])}. Put the names into the order of the network"
        )
    return ""


def _describe_labels_line(names: Sequence[str], clues: Clues) -> str:
    """Return the first line with one of the names in quotes."""
    for listing in clues.responders:
        for number, line in enumerate(listing.lines, 1):
            if any(f'"{name}"' in line or f"'{name}'" in line for name in names):
                return listing.locate(number)
    return _describe_prediction_line(clues)


def _describe_prediction_line(clues: Clues) -> str:
    return clues.describe_matching_line("responder", re.compile(r"\.predict\(|class_predict"))


def _has_prediction(clues: Clues) -> bool:
    return any(listing.find_line(_PREDICT_CALL) for listing in clues.responders)


def _hint_about_frequent_answer(accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on a name that most wrong answers have: the line that gives it, or the line that trains."""
    wrong_counts: Counter[str] = Counter()
    for truth, answer, count in accuracy.confusion:
        if answer is not None and answer != truth:
            wrong_counts[answer] += count
    if not wrong_counts or accuracy.value > _MAX_ACCURACY:
        return ""
    name, count = wrong_counts.most_common(1)[0]
    is_favourite = 2 * count > wrong_counts.total()
    for listing in clues.responders:
        for statement in listing.code.statements:
            if (
                is_favourite
                and statement.keyword == "return"
                and any(token[1:-1] == name for token in statement.tokens)
            ):
                head = next(
                    (one for one in listing.code.list_enclosing(statement) if one.keyword in ("if", "elif")), None
                )
                checked_part = (
                    f"the condition in line {head.line}, {join_tokens(head.condition)}"
                    if head
                    else "the rules above it"
                )
                return (
                    f"{listing.locate(statement.line)}: most images are called {quote_text(name)}. Check "
                    f"{checked_part}, and the pixels that it gets: black is near 0, white near 255"
                )
        fit_statement = next(
            (each for each in listing.code.statements if any(_is_fit_call(call) for call in each.calls)), None
        )
        if fit_statement is not None:
            return (
                f"{listing.locate(fit_statement.line)} trains a classifier that names most images wrongly, often as "
                f"{quote_text(name)}. Train longer (max_iter=300), and give each image the label that belongs to it"
            )
    return ""


def _is_fit_call(call: CallInCode) -> bool:
    return call.name.rpartition(".")[2] in ("fit", "partial_fit")


def _hint_about_constant_answer(answers: Mapping[str, str], accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint if all images get the same name."""
    if len(set(answers.values())) > 1 or len(answers) < 3 or not _has_prediction(clues):
        return ""
    answer = next(iter(answers.values()))
    is_normalised = any(each.find_line(_DIVISION) for each in clues.responders)
    fix = (
        "Print what you give to predict: it must be different for different images"
        if is_normalised
        else "The network is for numbers from 0 to 1: divide the image by its largest value"
    )
    return f"{_describe_prediction_line(clues)}: every image is called {quote_text(answer)}, whatever it shows. {fix}"


def _hint_about_unknown_label(result: CriterionResult, accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on an answer that is not a valid name."""
    unnamed = find_finding(result, UnnamedLabel)
    if unnamed is None or not accuracy.labels:
        return ""
    names = ", ".join(quote_text(label) for label in accuracy.labels[:3])
    answer = quote_text(unnamed.answer)
    return f"{_describe_prediction_line(clues)}: the answer is {answer}; expected one of the names, as {names}"
