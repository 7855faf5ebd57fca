"""Hints on misclassified images: names in another order, one answer for all, the wrong sensor's image.

They use the confusion matrix of the trials that the student may see.
"""

from __future__ import annotations

import difflib
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from service.grading.findings import UnnamedLabel
from service.grading.grade import Accuracy, CriterionResult
from service.grading.hint_clues import Clues, find_finding
from service.grading.hint_code import CallInCode, join_tokens
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.sentences import Sentence

_RIGHT = re.compile(r"""["']right["']|\bright(?:_\w*)?im(?:g|age)\w*|\bright_\w+""")
_LEFT = re.compile(r"""["']left["']|\bleft(?:_\w*)?im(?:g|age)\w*|\bleft_\w+""")
_DIVISION = re.compile(r"/\s*\(?\s*(?:max|255|\w+\.max|np\.|\w+)")
_PREDICT_CALL = re.compile(r"\.predict\w*\(|class_predict")
_CHANCE_AS_PLACE = re.compile(r"\bint\(.*\bmax\(|\[[^\]]*\bmax\(")
_ARGMAX = re.compile(r"\bargmax\b|\.index\(")
_NETWORK = re.compile(r"\bload(?:_onnx|_weights)?\(|\bMLPClassifier\(|\bcnn_load\(")
_TURN = re.compile(r"\w\.T\b|\btranspose\(|\brot90\(|\bflip(?:lr|ud)?\(|\[::-1\]")
_MAX_ACCURACY = 0.5
#: The least similarity of a misspelt name with its label, from 0 to 1.
_MIN_SIMILARITY = 0.8
_IMAGE = re.compile(r"IMG_DATA|[\"'](?:left|right)[\"']")
#: A name from a list by a fixed number.
_FIXED_NAME = re.compile(r"\b[^\W\d]\w*\[-?\d+\]\s*$")


def hint_about_recognition(clues: Clues) -> Iterator[str]:
    """Yield a hint for the first criterion that lost marks on images."""
    for result in (*clues.results, *(clues.practice if clues.lost else ())):
        accuracy = result.accuracy
        misspelt = "" if accuracy is None else _hint_about_misspelt_label(result, accuracy, clues)
        if misspelt:
            yield misspelt
            return
        if accuracy is None or accuracy.value > _MAX_ACCURACY + 0.2 or not accuracy.n:
            continue
        answers = {truth: answer for truth, answer, _ in accuracy.confusion if answer is not None}
        if accuracy.value <= _MAX_ACCURACY and answers:
            hint = (
                _hint_about_other_sensor(clues)
                or _hint_about_label_order(answers, clues)
                or _hint_about_turned_image(clues)
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


def hint_about_pixel_step(clues: Clues) -> Iterator[str]:
    """Yield a hint on ``[::3]`` for the pixels of an image, which have four numbers each."""
    for listing in clues.responders if clues.lost else ():
        is_about_images = listing.find_line(_IMAGE) is not None
        for statement in listing.code.statements if is_about_images else ():
            tokens = statement.tokens
            if any(tokens[at : at + 4] == (":", ":", "3", "]") for at in range(len(tokens) - 3)):
                yield Sentence(
                    "%(place)s takes every third number, but each pixel has four: red, green, blue and alpha. "
                    "Write 4 as the step, as in [::4]",
                    place=listing.locate(statement.line),
                )
                return


def _hint_about_other_sensor(clues: Clues) -> str:
    """Return a hint on the line that uses the right sensor's image, if no line uses the left one's."""
    for listing in clues.responders:
        line = listing.find_line(_RIGHT)
        if line is not None and not any(each.find_line(_LEFT) for each in clues.responders):
            return Sentence(
                "%(place)s uses the right sensor's image, but the picture lies under the left sensor. Write "
                "left instead of right",
                place=listing.locate(line),
            )
    return ""


def _hint_about_turned_image(clues: Clues) -> str:
    """Return a hint on the line that turns or mirrors the image."""
    for listing in clues.responders:
        line = listing.find_line(_TURN)
        if line is not None:
            return Sentence(
                "%(place)s turns or mirrors the image, and the network knows upright images. Leave it as it is",
                place=listing.locate(line),
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
        template = (
            translatable("%(place)s: %(first)s and %(second)s are swapped. Put the names into the order of the network")
            if _has_prediction(clues)
            else translatable("%(place)s: %(first)s and %(second)s are swapped. Exchange the two names")
        )
        return Sentence(template, place=location, first=quote_text(first_name), second=quote_text(second_name))
    if len(wrong_truths) < 3:
        return ""
    truth, answer = quote_text(wrong_truths[0]), quote_text(answers[wrong_truths[0]])
    if not _has_prediction(clues):
        return Sentence(
            "%(place)s: names are exchanged: %(truth)s is called %(answer)s. Check the conditions that lead to these "
            "names, and the values in them",
            place=location,
            truth=truth,
            answer=answer,
        )
    if len(wrong_truths) == len(answers):
        return Sentence(
            "%(place)s: every image gets another's name, so the names are shifted by one place or in another "
            "order: %(truth)s is called %(answer)s. Put the names into the order of the network, and count from 0",
            place=location,
            truth=truth,
            answer=answer,
        )
    return Sentence(
        "%(place)s: the names are in another order: %(truth)s is called %(answer)s. Put the names into the order of "
        "the network",
        place=location,
        truth=truth,
        answer=answer,
    )


def _describe_labels_line(names: Sequence[str], clues: Clues) -> str:
    """Return the first line with one of the names in quotes, or the one that asks the network."""
    return _find_quoted(names, clues) or _describe_prediction_line(clues)


def _find_quoted(names: Sequence[str], clues: Clues) -> str:
    """Return the first line with one of the names in quotes; empty if there is none."""
    for listing in clues.responders:
        for number, line in enumerate(listing.lines, 1):
            if any(f'"{name}"' in line or f"'{name}'" in line for name in names):
                return listing.locate(number)
    return ""


def _describe_prediction_line(clues: Clues) -> str:
    return clues.describe_matching_line("responder", _PREDICT_CALL)


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
                place, quoted_name = listing.locate(statement.line), quote_text(name)
                if head is None:
                    return Sentence(
                        "%(place)s: most images are called %(name)s. Check the rules above it, and the pixels that it "
                        "gets: black is near 0, white near 255",
                        place=place,
                        name=quoted_name,
                    )
                return Sentence(
                    "%(place)s: most images are called %(name)s. Check the condition in line %(line)s, %(condition)s, "
                    "and the pixels that it gets: black is near 0, white near 255",
                    place=place,
                    name=quoted_name,
                    line=head.line,
                    condition=join_tokens(head.condition),
                )
        fit_statement = next(
            (each for each in listing.code.statements if any(_is_fit_call(call) for call in each.calls)), None
        )
        if fit_statement is not None:
            return Sentence(
                "%(place)s trains a classifier that names most images wrongly, often as %(name)s. Train longer "
                "(max_iter=300), and give each image the label that belongs to it",
                place=listing.locate(fit_statement.line),
                name=quote_text(name),
            )
    return ""


def _is_fit_call(call: CallInCode) -> bool:
    return call.name.rpartition(".")[2] in ("fit", "partial_fit")


def _hint_about_constant_answer(answers: Mapping[str, str], accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint if all images get the same name."""
    if len(set(answers.values())) > 1 or len(answers) < 3:
        return ""
    answer = next(iter(answers.values()))
    if not _has_prediction(clues):
        has_network = any(listing.find_line(_NETWORK) for listing in clues.responders)
        line = _describe_fixed_line(answer, clues) if has_network else ""
        return line and Sentence(
            "%(place)s: every image is called %(name)s, because no line asks the network. Write "
            "names[int(network.predict(image)[0])] with your names for the list, the network and the image",
            place=line,
            name=quote_text(answer),
        )
    for listing in clues.responders:
        chance_line = listing.find_line(_CHANCE_AS_PLACE)
        if chance_line is not None and not any(each.find_line(_ARGMAX) for each in clues.responders):
            return Sentence(
                "%(place)s: every image is called %(name)s. max() is the largest chance, and not its place. Write "
                "argmax() in place of max()",
                place=listing.locate(chance_line),
                name=quote_text(answer),
            )
    is_normalised = any(each.find_line(_DIVISION) for each in clues.responders)
    template = (
        translatable(
            "%(place)s: every image is called %(name)s, whatever it shows. Print what you give to predict: it must be "
            "different for different images"
        )
        if is_normalised
        else translatable(
            "%(place)s: every image is called %(name)s, whatever it shows. The network is for numbers from 0 to 1: "
            "divide the image by its largest value"
        )
    )
    return Sentence(template, place=_describe_prediction_line(clues), name=quote_text(answer))


def _describe_fixed_line(name: str, clues: Clues) -> str:
    """Return the line that takes a name by a fixed number; otherwise the only one with the name; empty if unclear."""
    for listing in clues.responders:
        line = listing.find_line(_FIXED_NAME)
        quoted = [n for n, text in enumerate(listing.lines, 1) if f'"{name}"' in text or f"'{name}'" in text]
        if line is not None or len(quoted) == 1:
            return listing.locate(quoted[0] if line is None else line)
    return ""


def _hint_about_misspelt_label(result: CriterionResult, accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on a name in quotes that is nearly one of the labels, and is answered."""
    unnamed = find_finding(result, UnnamedLabel)
    similar = [] if unnamed is None else difflib.get_close_matches(unnamed.answer, accuracy.labels, 1, _MIN_SIMILARITY)
    line = _find_quoted([unnamed.answer], clues) if unnamed is not None and similar else ""
    return line and Sentence('%(place)s: write "%(label)s"', place=line, label=similar[0])


def _hint_about_unknown_label(result: CriterionResult, accuracy: Accuracy, clues: Clues) -> str:
    """Return a hint on an answer that is not a valid name."""
    unnamed = find_finding(result, UnnamedLabel)
    if unnamed is None or not accuracy.labels:
        return ""
    names = ", ".join(quote_text(label) for label in accuracy.labels[:3])
    return Sentence(
        "%(place)s: the answer is %(answer)s; expected one of the names, as %(names)s",
        place=_describe_prediction_line(clues),
        answer=quote_text(unnamed.answer),
        names=names,
    )
