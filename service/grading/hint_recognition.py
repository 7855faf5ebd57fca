"""Hints on misclassified images: names in another order, one answer for all, the wrong sensor's image.

They use the confusion matrix of the trials that the student may see.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from service.grading.grade import Accuracy, CriterionResult
from service.grading.hint_clues import Clues
from service.grading.hint_code import CallInCode, join_tokens
from service.grading.judging.message_parts import quote_text

_RIGHT = re.compile(r"""["']right["']|\bright(?:_\w*)?im(?:g|age)\w*|\bright_\w+""")
_LEFT = re.compile(r"""["']left["']|\bleft(?:_\w*)?im(?:g|age)\w*|\bleft_\w+""")
_DIVISION = re.compile(r"/\s*\(?\s*(?:max|255|\w+\.max|np\.|\w+)")
_NO_LABEL = re.compile(r"the answer names no label: (\"[^\"]{0,80}\")")
_PREDICT_CALL = re.compile(r"\.predict\w*\(|class_predict")
_MAX_ACCURACY = 0.5


def hint_about_recognition(clues: Clues) -> Iterator[str]:
    """Yield a hint for the first criterion that lost marks on images."""
    for result in (*clues.results, *(clues.practice if clues.lost else ())):
        accuracy = result.accuracy
        if accuracy is None or accuracy.value > _MAX_ACCURACY + 0.2 or not accuracy.n:
            continue
        taken = {truth: answer for truth, answer, _ in accuracy.confusion if answer is not None}
        if accuracy.value <= _MAX_ACCURACY and taken:
            found = (
                _hint_about_other_sensor(clues)
                or _hint_about_label_order(taken, clues)
                or _hint_about_constant_answer(taken, accuracy, clues)
            )
        else:
            found = _hint_about_label_order(taken, clues)
        found = (
            found or _hint_about_unknown_label(result, accuracy, clues) or _hint_about_frequent_answer(accuracy, clues)
        )
        if found:
            yield found
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


def _hint_about_label_order(taken: Mapping[str, str], clues: Clues) -> str:
    """Return a hint on class names in a different order than the network's: two swapped, or all shifted."""
    swapped = [(truth, answer) for truth, answer in taken.items() if truth != answer and taken.get(answer) == truth]
    wrong = [truth for truth, answer in taken.items() if truth != answer]
    if not wrong or len(set(taken.values())) < len(taken):
        return ""
    where = _describe_labels_line(taken, clues)
    if len(swapped) == len(wrong) == 2:
        one, other = swapped[0]
        order = "Put the names into the order of the network" if _has_prediction(clues) else "Exchange the two names"
        return f"{where}: {quote_text(one)} and {quote_text(other)} are swapped. {order}"
    if len(wrong) == len(taken) > 2:
        return (
            f"{where}: every image gets another's name, so the names are shifted by one place or in another order: "
            f"{quote_text(wrong[0])} is called {quote_text(taken[wrong[0]])}. Put the names into the order of the "
            "network, and "
            "count from 0"
        )
    if len(wrong) > 2:
        return (
            f"{where}: the names are in another order: {quote_text(wrong[0])} is called {quote_text(taken[wrong[0]])}. "
            "Put the names into the order of the network"
        )
    return ""


def _describe_labels_line(taken: Mapping[str, str], clues: Clues) -> str:
    """Return the first line with one of the names in quotes."""
    for listing in clues.responders:
        for number, line in enumerate(listing.lines, 1):
            if any(f'"{name}"' in line or f"'{name}'" in line for name in taken):
                return listing.locate(number)
    return _describe_prediction_line(clues)


def _describe_prediction_line(clues: Clues) -> str:
    return clues.describe_matching_line("responder", re.compile(r"\.predict\(|class_predict"))


def _has_prediction(clues: Clues) -> bool:
    return any(listing.find_line(_PREDICT_CALL) for listing in clues.responders)


def _hint_about_frequent_answer(accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on a name that most wrong answers have: the line that gives it, or the line that trains."""
    wrong: Counter[str] = Counter()
    for truth, answer, count in accuracy.confusion:
        if answer is not None and answer != truth:
            wrong[answer] += count
    if not wrong or accuracy.value > _MAX_ACCURACY:
        return ""
    name, count = wrong.most_common(1)[0]
    is_favourite = 2 * count > wrong.total()
    for listing in clues.responders:
        for each in listing.code.statements:
            if is_favourite and each.keyword == "return" and any(token[1:-1] == name for token in each.tokens):
                head = next((one for one in listing.code.list_enclosing(each) if one.keyword in ("if", "elif")), None)
                check = (
                    f"the condition in line {head.line}, {join_tokens(head.condition)}"
                    if head
                    else "the rules above it"
                )
                return (
                    f"{listing.locate(each.line)}: most images are called {quote_text(name)}. Check {check}, and "
                    "the pixels "
                    "that it gets: black is near 0, white near 255"
                )
        fit = next((each for each in listing.code.statements if any(_is_fit_call(call) for call in each.calls)), None)
        if fit is not None:
            return (
                f"{listing.locate(fit.line)} trains a classifier that names most images wrongly, often as "
                f"{quote_text(name)}. "
                "Train longer (max_iter=300), and give each image the label that belongs to it"
            )
    return ""


def _is_fit_call(call: CallInCode) -> bool:
    return call.name.rpartition(".")[2] in ("fit", "partial_fit")


def _hint_about_constant_answer(taken: Mapping[str, str], accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint if all images get the same name."""
    if len(set(taken.values())) > 1 or len(taken) < 3 or not _has_prediction(clues):
        return ""
    answer = next(iter(taken.values()))
    normalises = any(each.find_line(_DIVISION) for each in clues.responders)
    fix = (
        "Print what you give to predict: it must be different for different images"
        if normalises
        else "The network is for numbers from 0 to 1: divide the image by its largest value"
    )
    return f"{_describe_prediction_line(clues)}: every image is called {quote_text(answer)}, whatever it shows. {fix}"


def _hint_about_unknown_label(result: CriterionResult, accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on an answer that is not a valid name."""
    found = next((_NO_LABEL.search(each.message) for each in result.evidence if not each.passed), None)
    if found is None or not accuracy.labels:
        return ""
    names = ", ".join(quote_text(label) for label in accuracy.labels[:3])
    return f"{_describe_prediction_line(clues)}: the answer is {found[1]}; expected one of the names, as {names}"
