"""The near misses that are known: what each looks like, and a sentence on what was found and what is expected.

A rule needs evidence from a trial wherever its mistake leaves some; the text of a submission then only tells the line.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator
from dataclasses import replace

from responders.message_format import IMG_DATA, JSON, PY, kind
from service.grading.hint_clues import Clues, Listing
from service.grading.judging.words import quoted
from sim.recorded import faults_of, stood_still
from sim.recording import Fault, Verdict
from submissions.assignment.second_robot import SECOND_PROGRAM
from submissions.bundle import meant_as
from submissions.criteria.line import Follows, Laps
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves
from submissions.criteria.path import Visits
from submissions.criteria.point import Circuits
from submissions.magics import magic_place
from submissions.marked_cell import NEARLY_MAGIC
from submissions.raw_files import shown
from submissions.submission import PART_FILES

_NOTEBOOK_LINE = re.compile(r"^\s*[%!]")
_NEARLY_PY = re.compile(r"""\s*["']?(?:p\s*y\s*[:;.]{1,3}|\w{1,6}::)""", re.IGNORECASE)
_NEARLY_JSON = re.compile(r"""\s*["']?json\s*[:;]{0,3}\s*(?=[\[{"'])""", re.IGNORECASE)
_RESPONDER = re.compile(r"^(\s*)def\s+(responder|\w+_responder)\b")
_DEFINED = re.compile(r"^def\s+(\w+)")
_PRINT = re.compile(r"\bprint\s*\(")
_RETURNS = re.compile(r"\breturn\s+[^\s#]")
_RETURNS_OBJECT = re.compile(r"\breturn\b(?!.*JSON::).*(?:dumps|str\s*\(|\{)")
_NO_ERRORS = (Verdict.TIME_LIMIT, Verdict.HOST_ERROR, Verdict.ASSIGNMENT_ERROR)
_MOST_ERRORS, _LONGEST_ERROR = 3, 300
#: What to do about an error, by its words and, after a line feed, the line that it is in.
_ADVICE = [
    (re.compile(error), advice)
    for error, advice in (
        (r"can only concatenate str", "Put str() round what is no text, or use an f-string."),
        (r"^(?:IndentationError|TabError)", "The lines of one block begin with the same blanks; use no tabs."),
        (r"^SyntaxError: invalid character '[\u2018-\u201f]", "Type straight quotes, as they are on the keyboard."),
        (r"(?s)^IndexError.*pyState", "The queue was still empty: wait until an answer has come."),
        (r"^TypeError: \w*responder\(\) takes", "A responder takes one value: the text that was sent."),
        (r"^KeyError", "There is nothing under this key: print the object to see what it has."),
        (r"^TypeError: dump\(\)", "Did you mean json.dumps?"),
    )
]
#: What a robot that stands still has no marks for.
_DRIVEN = (Circuits, Displacement, Encounters, Excursions, Follows, Laps, Moves, Visits)
_NO_NAME = re.compile(r"NameError: name '(\w+)' is not defined")
_NOTHING_RETURNED = "the responder returned NoneType"
#: What ``image_data`` without a side comes to.
_NO_SIDE = "undefined image data logged..."
_NEAR = 0.75
#: What %%sim_magic_preloaded binds and the other magics do not.
PRELOADED = frozenset(("say", "speaker", "tank_turn", "tank_drive", "ultrasonic", "colorLeft", "colorRight", "gyro"))


def of_missing_files(clues: Clues) -> Iterator[str]:
    """A part that is there under nearly its name."""
    near = meant_as(clues.missing, clues.files) if clues.missing is not None else ""
    if clues.missing is not None and near:
        yield f"there is {shown(near)}, but no {PART_FILES[clues.missing]}; expected that name, so rename it"


def of_magics(clues: Clues) -> Iterator[str]:
    """A magic line below other code, without its %, or of a kind that only a notebook can have."""
    faulty = [fault for fault in clues.faults if fault.message.startswith(("SyntaxError", "NameError"))]
    for listing in clues.listings:
        if listing.part is None:
            continue
        lines = [fault.line for fault in faulty if _name_of(fault) == listing.name]
        if not lines:
            continue
        place = magic_place("\n".join(listing.lines))
        for number, line in enumerate(listing.lines, 1):
            if place == number - 1 and listing.part == "program":
                continue
            if NEARLY_MAGIC.match(line):
                yield _of_magic(listing, number, line)
                return
            if number in lines and _NOTEBOOK_LINE.match(line):
                yield f"{listing.at(number)} is {quoted(line)}, which only a notebook can run; expected Python"
                return


def _of_magic(listing: Listing, number: int, line: str) -> str:
    what = f"{listing.at(number)} is {quoted(line)}"
    if listing.part == "responder":
        return f"{what}, which begins a robot program; expected it in robot.py alone"
    above = next((n for n, text in enumerate(listing.lines[: number - 1], 1) if not _is_empty(text)), None)
    if above is not None:
        code = quoted(listing.lines[above - 1])
        return f"{what}, but line {above}, {code}, stands above it; expected only blank lines and comments there"
    return f"{what}; expected %%sim_magic_preloaded and its flags"


def of_responder_names(clues: Clues) -> Iterator[str]:
    """A function that is nearly called responder."""
    if not any("there is no responder: " in fault.message for fault in clues.faults):
        return
    for listing in clues.of("responder"):
        for number, line in enumerate(listing.lines, 1):
            name = _DEFINED.match(line)
            if name and _ratio(name[1].lower(), "responder") >= _NEAR:
                yield f"{listing.at(number)} defines {shown(name[1])}; expected a function called responder"


def of_errors(clues: Clues) -> Iterator[str]:
    """The first error of a trial in its own words, with what was probably meant."""
    firsts = (faults[0] for recording in clues.recordings if (faults := faults_of(recording)))
    for fault in list(dict.fromkeys(replace(each, t=0.0) for each in firsts))[:_MOST_ERRORS]:
        where, code = _place(fault, clues)
        if not where or fault.verdict in _NO_ERRORS:
            continue
        name = _NO_NAME.match(fault.message)
        if name and fault.who == "program" and clues.preamble != "preloaded" and name[1] in PRELOADED:
            yield (
                f"{where} uses {name[1]}, which %%sim_magic_preloaded brings; expected that magic in the first line, "
                "or the name to be defined"
            )
            continue
        advice = fault.hint or next((words for error, words in _ADVICE if error.search(f"{fault.message}\n{code}")), "")
        sentence = fault.message[:_LONGEST_ERROR].rstrip(".")
        end = "" if not advice or sentence.endswith("?") else "."
        yield f"{where}: {sentence}{end}{advice and ' '}{advice}"


def of_messages(clues: Clues) -> Iterator[str]:
    """A print that is nearly a message."""
    if not clues.collaborative or not any(clues.of("program")):
        return
    for text in clues.printed:
        begin = _NEARLY_PY.match(text)
        if begin and not text.startswith(PY):
            yield (
                f'{clues.where("program", _literal(begin[0]))} prints "{text[:60]}", which is not sent as a message; '
                f'expected "{PY}" at its very start, in capitals, with two colons and no blank'
            )
            return


def of_images(clues: Clues) -> Iterator[str]:
    """A print that nearly sends the images."""
    if not clues.collaborative or not any(clues.of("program")):
        return
    for text in (*clues.printed, *clues.sent):
        if kind(text) == "image":
            continue
        said = text[:40].partition(":{")[0]
        word = said.removeprefix(PY).strip(" :'\"")
        near = max(_ratio(word.upper(), IMG_DATA), _ratio(word.upper(), "IMAGE_DATA"))
        if text != _NO_SIDE and near < _NEAR:
            continue
        printed = "image_data" if text == _NO_SIDE else text
        where = clues.where("program", _literal("image_data" if text == _NO_SIDE else said))
        yield f'{where} prints {quoted(printed)}, which sends no image; expected "{IMG_DATA}" and nothing before it'
        return


def of_printed_answers(clues: Clues) -> Iterator[str]:
    """A responder that comes to its end without a return."""
    if not any(fault.message.startswith(_NOTHING_RETURNED) for fault in clues.faults):
        return
    for listing in clues.of("responder"):
        for number, line in enumerate(listing.lines, 1):
            head = _RESPONDER.match(line)
            if head is None:
                continue
            body = list(_body(listing, number, len(head[1])))
            if any(_RETURNS.search(text) for _, text in body):
                continue
            prints = next((n for n, text in body if _PRINT.search(text)), None)
            if prints is not None:
                said = quoted(listing.lines[prints - 1])
                yield f"{listing.at(prints)}, {said}, prints the answer and nothing returns it; expected return"
            else:
                yield f"{listing.at(number)}: {head[2]} has no return with an answer; expected one"
            return


def _body(listing: Listing, number: int, indent: int) -> Iterator[tuple[int, str]]:
    for place, text in enumerate(listing.lines[number:], number + 1):
        if text.strip() and len(text) - len(text.lstrip()) <= indent:
            return
        yield place, text


def of_stillness(clues: Clues) -> Iterator[str]:
    """A robot that should drive and never did."""
    drives = any(isinstance(each, _DRIVEN) for each in clues.lost)
    if drives and clues.recordings and all(stood_still(each) for each in clues.recordings):
        yield "the robot never moved; expected the program to switch its motors on"


def of_answers(clues: Clues) -> Iterator[str]:
    """An answer that is nearly an object for the robot's queue."""
    if not any(clues.of("responder")):
        return
    for text in clues.answers:
        if text.startswith(JSON):
            continue
        begin = _NEARLY_JSON.match(text)
        if begin:
            where = clues.where("responder", _literal(begin[0].rstrip(" [{\"'")))
        elif text.lstrip().startswith("{") and _wants_queue(clues):
            where = clues.where("responder", _RETURNS_OBJECT)
        else:
            continue
        yield f'{where}: the answer is {quoted(text)}, which joins no queue; expected "{JSON}" at its very start'
        return


def _wants_queue(clues: Clues) -> bool:
    """Whether anything is asked of objects, or the program looks for some."""
    asked = any(
        getattr(each, "is_json", False) or getattr(each, "path", None) or getattr(each, "json_queue", False)
        for each in clues.lost
    )
    return asked or any(listing.find(re.compile("pyState")) for listing in clues.of("program"))


def _place(fault: Fault, clues: Clues) -> tuple[str, str]:
    """Where a fault is, and the line; empty where that is no text of the student's."""
    name = _name_of(fault)
    listing = next((each for each in clues.listings if each.name == name), Listing(shown(name), None, ()))
    if not listing.lines and name not in clues.files:
        return "", ""
    return listing.at(fault.line), "".join(listing.lines[(fault.line or 0) - 1 : fault.line])


def _name_of(fault: Fault) -> str:
    if fault.file:
        return fault.file
    if fault.cell is not None:
        return f"cell {fault.cell}"
    parts = {"program": "robot.py", "responder": "responder.py", "second program": SECOND_PROGRAM}
    return f"{fault.agent}.py" if fault.agent else parts.get(fault.who, "")


def _is_empty(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _literal(begin: str) -> re.Pattern[str]:
    """A text in quotes that begins so."""
    return re.compile(rf"""["']\s*{re.escape(begin.strip())}(?!:)""")


def _ratio(one: str, other: str) -> float:
    return difflib.SequenceMatcher(None, one, other).ratio()
