"""Rules for known near misses: how to detect each one, and a sentence on what was found and what is expected.

A rule needs evidence from a trial if its mistake leaves any. The submission's text then only supplies the line.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator

from responders.message_format import IMG_DATA, JSON, PY, classify_text
from service.grading.fault_kinds import FaultKind, is_kind
from service.grading.hint_clues import Clues, Listing, name_faulty_text
from service.grading.judging.message_parts import quote_text
from sim.sentences import Sentence
from submissions.file_kinds import find_similar_file
from submissions.notebook import NEARLY_MAGIC
from submissions.raw_files import sanitise_name
from submissions.submission import PART_FILES

_NOTEBOOK_LINE = re.compile(r"^\s*[%!]")
#: A return of an object, in any form.
RETURN_LINE = re.compile(r"\breturn\b.*(?:dumps|JSON::|\{)")
_NEARLY_PY = re.compile(r"""\s*["']?(?:p\s*y\s*[:;.]{1,3}|\w{1,6}::)""", re.IGNORECASE)
#: A message with a text before it.
_LATE_PY = re.compile(r"[^\n]{1,60}?[ \"'>:]((?:PY::|IMG_DATA).*)")
_NAME_IN_TEXT = re.compile(r"PY::(\{?[A-Za-z_]\w*\}?)$")
_KEY = re.compile(r"""["'](\w+)["']\s*:""")
_NEARLY_JSON = re.compile(r"""\s*["']?json\s*[:;]{0,3}\s*(?=[\[{"'])""", re.IGNORECASE)
_RETURNS_OBJECT = re.compile(r"\breturn\b(?!.*JSON::).*(?:dumps|str\s*\(|\{)")
#: The log entry of ``image_data`` without a side.
_NO_SIDE = "undefined image data logged..."
_MIN_SIMILARITY = 0.75


def hint_about_missing_files(clues: Clues) -> Iterator[str]:
    """Yield a hint on a part that was submitted under a similar file name."""
    similar_name = find_similar_file(clues.missing, clues.files) if clues.missing is not None else ""
    if clues.missing is not None and similar_name:
        yield Sentence(
            "there is %(similar)s, but no %(file)s; expected that name, so rename it",
            similar=sanitise_name(similar_name),
            file=PART_FILES[clues.missing],
        )


def hint_about_empty_parts(clues: Clues) -> Iterator[str]:
    """Yield a hint on a part that contains only blank lines and comments."""
    for listing in clues.listings:
        if (
            listing.part is not None
            and not listing.code.statements
            and all(not line.strip() or line.lstrip().startswith("#") for line in listing.lines)
        ):
            yield Sentence(
                "%(file)s is empty. Write your program in it, save it, and submit it again", file=listing.name
            )
            return


def hint_about_magics(clues: Clues) -> Iterator[str]:
    """Yield a hint on a magic line that is below other code, lacks its %, or is valid only in a notebook."""
    syntax_faults = [each for each in clues.faults if is_kind(each, FaultKind.SYNTAX_ERROR, FaultKind.NAME_ERROR)]
    for listing in clues.listings:
        if listing.part is None:
            continue
        lines = [fault.line for fault in syntax_faults if name_faulty_text(fault) == listing.name]
        if not lines:
            continue
        magic_index = listing.magic_place
        for number, line in enumerate(listing.lines, 1):
            if magic_index == number - 1 and listing.part == "program":
                continue
            if NEARLY_MAGIC.match(line):
                yield _hint_about_magic(listing, number, line)
                return
            if number in lines and _NOTEBOOK_LINE.match(line):
                yield Sentence(
                    "%(place)s is %(code)s, which only a notebook can run; expected Python",
                    place=listing.locate(number),
                    code=quote_text(line),
                )
                return


def _hint_about_magic(listing: Listing, number: int, line: str) -> str:
    place, code = listing.locate(number), quote_text(line)
    if listing.part == "responder":
        return Sentence(
            "%(place)s is %(code)s, which begins a robot program; expected it in robot.py alone", place=place, code=code
        )
    code_line = next((n for n, text in enumerate(listing.lines[: number - 1], 1) if not _is_empty_line(text)), None)
    if code_line is not None:
        return Sentence(
            "%(place)s is %(code)s, but line %(other_line)s, %(other_code)s, stands above it; expected only blank "
            "lines and comments there",
            place=place,
            code=code,
            other_line=code_line,
            other_code=quote_text(listing.lines[code_line - 1]),
        )
    return Sentence("%(place)s is %(code)s; expected %%%%sim_magic_preloaded and its flags", place=place, code=code)


def hint_about_messages(clues: Clues) -> Iterator[str]:
    """Yield a hint on a printed text that is almost a message."""
    if not clues.collaborative or not any(clues.list_texts("program")):
        return
    for text in clues.printed:
        late_match = _LATE_PY.match(text)
        if late_match and not clues.sent and not text.startswith(PY):
            location = clues.describe_matching_line("program", re.compile(r"""["'](?:PY::|IMG_DATA)"""))
            yield Sentence(
                "%(place)s prints %(text)s, which is not sent as a message; expected %(message)s at the start of the "
                "text. Print the other words with a print of their own",
                place=location,
                text=quote_text(text),
                message=quote_text(late_match[1]),
            )
            return
        prefix_match = _NEARLY_PY.match(text)
        if prefix_match and not text.startswith(PY):
            yield Sentence(
                '%(place)s prints "%(text)s", which is not sent as a message; expected "%(prefix)s" at its very start, '
                "in capitals, with two colons and no blank",
                place=clues.describe_matching_line("program", _build_literal_pattern(prefix_match[0])),
                text=text[:60],
                prefix=PY,
            )
            return


def hint_about_images(clues: Clues) -> Iterator[str]:
    """Yield a hint on a printed text that almost sends the images."""
    if not clues.collaborative or not any(clues.list_texts("program")):
        return
    for text in (*clues.printed, *clues.sent):
        if classify_text(text) == "image":
            continue
        printed_prefix = text[:40].partition(":{")[0]
        keyword = printed_prefix.removeprefix(PY).strip(" :'\"")
        similarity = max(
            _measure_similarity(keyword.upper(), IMG_DATA), _measure_similarity(keyword.upper(), "IMAGE_DATA")
        )
        if text != _NO_SIDE and similarity < _MIN_SIMILARITY:
            continue
        printed_text = "image_data" if text == _NO_SIDE else text
        location = clues.describe_matching_line(
            "program", _build_literal_pattern("image_data" if text == _NO_SIDE else printed_prefix)
        )
        yield Sentence(
            '%(place)s prints %(text)s, which sends no image; expected "%(word)s" and nothing before it',
            place=location,
            text=quote_text(printed_text),
            word=IMG_DATA,
        )
        return


def hint_about_image_log(clues: Clues) -> Iterator[str]:
    """Yield a hint on a print that logs no image because it names no side."""
    if not clues.collaborative and clues.lost and _NO_SIDE in clues.printed:
        location = clues.describe_matching_line("program", _build_literal_pattern("image_data"))
        yield Sentence(
            '%(place)s prints "image_data" without a side, so no image is logged. Write "image_data both", '
            '"image_data left" or "image_data right"',
            place=location,
        )


def hint_about_quoted_names(clues: Clues) -> Iterator[str]:
    """Yield a hint on a message that contains a variable's name instead of its value."""
    for text in (*clues.sent, *clues.printed) if clues.lost else ():
        match = _NAME_IN_TEXT.match(text)
        if match is None:
            continue
        variable = match[1].strip("{}")
        if any(variable in each.bound_names for listing in clues.programs for each in listing.code.statements):
            location = clues.describe_matching_line("program", re.compile(re.escape(f"{PY}{match[1]}")))
            fixed_text = f'f"{PY}{{{variable}}}"'
            yield Sentence(
                '%(place)s sends %(text)s: the name, and not its value such as "%(example)s"; expected %(code)s',
                place=location,
                text=quote_text(text),
                example=f"{PY}0",
                code=fixed_text,
            )
            return


def hint_about_answers(clues: Clues) -> Iterator[str]:
    """Yield a hint on an answer that is almost an object for the robot's queue."""
    if not any(clues.list_texts("responder")):
        return
    for text in clues.answers:
        if text.startswith(JSON):
            continue
        prefix_match = _NEARLY_JSON.match(text)
        if prefix_match:
            location = clues.describe_matching_line(
                "responder", _build_literal_pattern(prefix_match[0].rstrip(" [{\"'"))
            )
        elif text.lstrip().startswith("{") and clues.should_use_queue:
            location = describe_return_line(text, clues)
        else:
            continue
        yield Sentence(
            "%(place)s: the answer is %(answer)s, which is not added to the message queue; expected "
            '"%(prefix)s" at its very start',
            place=location,
            answer=quote_text(text),
            prefix=JSON,
        )
        return


def describe_return_line(text: str, clues: Clues, pattern: re.Pattern[str] = _RETURNS_OBJECT) -> str:
    """Return the line of the last return whose keys are all in the answer; otherwise the first matching line."""
    for listing in clues.responders:
        for number, line in reversed(list(enumerate(listing.lines, 1))):
            if pattern.search(line) and all(key in text for key in _KEY.findall(line)):
                return listing.locate(number)
    return clues.describe_matching_line("responder", pattern)


def _is_empty_line(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _build_literal_pattern(opening: str) -> re.Pattern[str]:
    """Return a pattern for a quoted text with this beginning."""
    return re.compile(rf"""["']\s*{re.escape(opening.strip())}(?!:)""")


def _measure_similarity(first: str, second: str) -> float:
    return difflib.SequenceMatcher(None, first, second).ratio()
