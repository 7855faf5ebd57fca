"""A report and its replay are in the reader's language: none of our texts is in another one."""

from __future__ import annotations

import gettext
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from html.parser import HTMLParser
from typing import Any

import pytest

from replays import data_of, island_of
from report_builders import astray_grade, faulty_grade, hidden_grade, line_follower_grade, shape_grade, swept_grade
from service.grading.grade import Grade
from service.grading.judging.message_parts import add_hidden_note
from service.language import Language, load_language
from service.message_catalogue import extract_messages
from service.reports.html import load_report_script, render_report_page
from service.reports.plots.grade_plots import list_plots
from service.reports.view import View, build_staff_view, build_student_view

GERMAN = load_language("de")
GRADES = (astray_grade, faulty_grade, hidden_grade, line_follower_grade, shape_grade, swept_grade)
_PIXEL = bytes.fromhex("89504e470d0a1a0a0000000d4948445200000001000000010100000000376ef924")
_WORD = re.compile(r"[^\W\d_]{3,}")
#: Texts that are equal in every language: our names, units, formats.
_NO_SENTENCE = {"Robomark", "JSON", "IMG", "DATA"}


@dataclass(eq=False)
class Foreign(gettext.NullTranslations):
    """Puts every translated text into angle brackets, and records the texts."""

    sentences: set[str] = field(default_factory=set)

    def gettext(self, message: str) -> str:
        self.sentences.add(message)
        return f"⟨{message}⟩"

    def ngettext(self, one: str, many: str, count: int) -> str:
        self.sentences.add(one)
        return f"⟨{one if count == 1 else many}⟩"


class Texts(HTMLParser):
    """The texts of a page, and of the attributes that are visible or read aloud."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[str] = []
        self._silent = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._silent = tag in ("script", "style")
        self.found += [value or "" for name, value in attrs if name in ("alt", "aria-label", "title", "data-before")]

    def handle_endtag(self, tag: str) -> None:
        self._silent = False

    def handle_data(self, data: str) -> None:
        if not self._silent:
            self.found.append(data)


def page_of(view: View) -> str:
    return render_report_page(view, {plot.name: _PIXEL for plot in list_plots(view.grade)})


def unbracketed(text: str) -> str:
    while (shorter := re.sub(r"⟨[^⟨⟩]*⟩", "", text)) != text:
        text = shorter
    return text


def texts_in(value: object) -> Iterator[str]:
    """Yield every text in a grade."""
    if isinstance(value, str):
        yield value
    elif is_dataclass(value) and not isinstance(value, type):
        for each in fields(value):
            yield from texts_in(getattr(value, each.name))
    elif isinstance(value, tuple | list | frozenset):
        for each in value:
            yield from texts_in(each)


def texts_of_replay(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, each in value.items():
            if key not in ("columns", "image", "images", "format", "verdict", "kind", "who", "from", "to"):
                yield from texts_of_replay(each)
    elif isinstance(value, list):
        for each in value:
            yield from texts_of_replay(each)


@pytest.fixture(scope="module")
def foreign() -> Foreign:
    return Foreign()


@pytest.mark.parametrize("made", GRADES)
def test_nothing_of_ours_is_said_in_another_language(made: Callable[[], Grade], foreign: Foreign) -> None:
    grade, language = made(), Language("xx", foreign)
    # Texts written during grading stay unchanged.
    kept = {word for text in (*texts_in(grade), add_hidden_note("")) for word in _WORD.findall(text)}
    for view in (build_staff_view(grade, language), build_student_view(grade, language=language)):
        page = page_of(view)
        document = [*Texts(page).found, *texts_of_replay(data_of(page) if view.grade.trials else {})]
        left = {word for text in document for word in _WORD.findall(unbracketed(text))}
        assert left - kept - _NO_SENTENCE == set()


def test_everything_that_is_said_is_in_the_catalogues(foreign: Foreign) -> None:
    for made in GRADES:
        page_of(build_staff_view(made(), Language("xx", foreign)))
    known = {each.id if isinstance(each.id, str) else each.id[0] for each in extract_messages() if each.id}
    assert foreign.sentences - known == {"°"}, "what is said inside an f-string is not found"


def test_a_german_report_is_german() -> None:
    page = page_of(build_student_view(shape_grade(), language=GERMAN))
    assert '<html lang="de">' in page
    for words in ("Punkten</span>", "<h2>Wiedergabe</h2>", "wurde als", "Die meisten Punkte gibt es", "Alle Läufe"):
        assert words in page
    assert island_of(page)["words"]["sentences"]["play"] == "Abspielen"
    assert data_of(page)["trials"][0]["ended"] == "abgeschlossen"


def test_the_script_of_a_replay_asks_for_all_the_words_that_there_are_and_no_others() -> None:
    code = load_report_script()
    words = island_of(page_of(build_student_view(line_follower_grade())))["words"]
    literals = set(re.findall(r'"(\w+)"', code))
    assert set(re.findall(r'\bsay\("(\w+)"', code)) <= set(words["sentences"]) <= literals
    assert set(re.findall(r'\bworded\("(\w+)"', code)) <= set(words)
