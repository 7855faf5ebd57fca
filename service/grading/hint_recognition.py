"""Hints on misclassified images: names in another order, one answer for all, the wrong sensor's image.

They use the confusion matrix of the trials that the student may see.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping

from service.grading.grade import Accuracy, CriterionResult
from service.grading.hint_clues import Clues
from service.grading.hint_code import CallInCode, joined
from service.grading.judging.message_parts import quoted

_RIGHT = re.compile(r"""["']right["']|\bright(?:_\w*)?im(?:g|age)\w*|\bright_\w+""")
_LEFT = re.compile(r"""["']left["']|\bleft(?:_\w*)?im(?:g|age)\w*|\bleft_\w+""")
_DIVIDES = re.compile(r"/\s*\(?\s*(?:max|255|\w+\.max|np\.|\w+)")
_NO_LABEL = re.compile(r"the answer names no label: (\"[^\"]{0,80}\")")
_PREDICTS = re.compile(r"\.predict\w*\(|class_predict")
_MOST = 0.5


def of_recognition(clues: Clues) -> Iterator[str]:
    """Yield a hint for the first criterion that lost marks on images."""
    for result in (*clues.results, *(clues.practice if clues.lost else ())):
        accuracy = result.accuracy
        if accuracy is None or accuracy.value > _MOST + 0.2 or not accuracy.n:
            continue
        taken = {truth: answer for truth, answer, _ in accuracy.confusion if answer is not None}
        if accuracy.value <= _MOST and taken:
            found = _of_other_sensor(clues) or _of_order(taken, clues) or _of_constant(taken, accuracy, clues)
        else:
            found = _of_order(taken, clues)
        found = found or _of_unknown(result, accuracy, clues) or _of_favourite(accuracy, clues)
        if found:
            yield found
            return


def _of_other_sensor(clues: Clues) -> str:
    """Return a hint on the line that uses the right sensor's image, if no line uses the left one's."""
    for listing in clues.responders:
        line = listing.find(_RIGHT)
        if line is not None and not any(each.find(_LEFT) for each in clues.responders):
            return (
                f"{listing.at(line)} uses the right sensor's image, but the picture lies under the left sensor. "
                f"Write left in place of right"
            )
    return ""


def _of_order(taken: Mapping[str, str], clues: Clues) -> str:
    """Return a hint on class names in a different order than the network's: two swapped, or all shifted."""
    swapped = [(truth, answer) for truth, answer in taken.items() if truth != answer and taken.get(answer) == truth]
    wrong = [truth for truth, answer in taken.items() if truth != answer]
    if not wrong or len(set(taken.values())) < len(taken):
        return ""
    where = _list_of(taken, clues)
    if len(swapped) == len(wrong) == 2:
        one, other = swapped[0]
        order = "Put the names into the order of the network" if _predicts(clues) else "Exchange the two names"
        return f"{where}: {quoted(one)} and {quoted(other)} are swapped. {order}"
    if len(wrong) == len(taken) > 2:
        return (
            f"{where}: every image gets another's name, so the names are shifted by one place or in another order: "
            f"{quoted(wrong[0])} is called {quoted(taken[wrong[0]])}. Put the names into the order of the network, and "
            "count from 0"
        )
    if len(wrong) > 2:
        return (
            f"{where}: the names are in another order: {quoted(wrong[0])} is called {quoted(taken[wrong[0]])}. "
            "Put the names into the order of the network"
        )
    return ""


def _list_of(taken: Mapping[str, str], clues: Clues) -> str:
    """Return the first line with one of the names in quotes."""
    for listing in clues.responders:
        for number, line in enumerate(listing.lines, 1):
            if any(f'"{name}"' in line or f"'{name}'" in line for name in taken):
                return listing.at(number)
    return _predicting(clues)


def _predicting(clues: Clues) -> str:
    return clues.where("responder", re.compile(r"\.predict\(|class_predict"))


def _predicts(clues: Clues) -> bool:
    return any(listing.find(_PREDICTS) for listing in clues.responders)


def _of_favourite(accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on a name that most wrong answers have: the line that gives it, or the line that trains."""
    wrong: Counter[str] = Counter()
    for truth, answer, count in accuracy.confusion:
        if answer is not None and answer != truth:
            wrong[answer] += count
    if not wrong or accuracy.value > _MOST:
        return ""
    name, count = wrong.most_common(1)[0]
    is_favourite = 2 * count > wrong.total()
    for listing in clues.responders:
        for each in listing.code.statements:
            if is_favourite and each.keyword == "return" and any(token[1:-1] == name for token in each.tokens):
                head = next((one for one in listing.code.around(each) if one.keyword in ("if", "elif")), None)
                check = f"the condition in line {head.line}, {joined(head.condition)}" if head else "the rules above it"
                return (
                    f"{listing.at(each.line)}: most images are called {quoted(name)}. Check {check}, and the pixels "
                    "that it gets: black is near 0, white near 255"
                )
        fit = next((each for each in listing.code.statements if any(_fits(call) for call in each.calls)), None)
        if fit is not None:
            return (
                f"{listing.at(fit.line)} trains a classifier that names most images wrongly, often as {quoted(name)}. "
                "Train longer (max_iter=300), and give each image the label that belongs to it"
            )
    return ""


def _fits(call: CallInCode) -> bool:
    return call.name.rpartition(".")[2] in ("fit", "partial_fit")


def _of_constant(taken: Mapping[str, str], accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint if all images get the same name."""
    if len(set(taken.values())) > 1 or len(taken) < 3 or not _predicts(clues):
        return ""
    answer = next(iter(taken.values()))
    normalises = any(each.find(_DIVIDES) for each in clues.responders)
    fix = (
        "Print what you give to predict: it must be different for different images"
        if normalises
        else "The network is for numbers from 0 to 1: divide the image by its largest value"
    )
    return f"{_predicting(clues)}: every image is called {quoted(answer)}, whatever it shows. {fix}"


def _of_unknown(result: CriterionResult, accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on an answer that is not a valid name."""
    found = next((_NO_LABEL.search(each.message) for each in result.evidence if not each.passed), None)
    if found is None or not accuracy.labels:
        return ""
    names = ", ".join(quoted(label) for label in accuracy.labels[:3])
    return f"{_predicting(clues)}: the answer is {found[1]}; expected one of the names, as {names}"
