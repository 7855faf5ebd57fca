"""Sentences are English text that can still be translated after pickling, copying and nesting."""

from __future__ import annotations

import copy
import gettext
import pickle

import pytest

from service.language import Language
from sim.sentences import Sentence, drop_full_stop, join_sentences, join_with_and, make_clause


class _Brackets(gettext.NullTranslations):
    """A language that writes every template in brackets."""

    def gettext(self, message: str) -> str:
        return f"⟨{message}⟩"


BRACKETS = Language("xx", _Brackets())
NESTED = Sentence("%(place)s: %(seconds).2f s", place=Sentence("at the line"), seconds=2.5)


@pytest.mark.parametrize("copied", [pickle.loads(pickle.dumps(NESTED)), copy.deepcopy(NESTED), copy.copy(NESTED)])
def test_a_sentence_is_text_and_remembers_its_template(copied: Sentence) -> None:
    assert copied == "at the line: 2.50 s"
    assert (copied.template, dict(copied.values)) == (NESTED.template, dict(NESTED.values))
    assert BRACKETS.translate_sentence(copied) == "⟨⟨at the line⟩: 2.50 s⟩"


def test_a_sentence_without_values_is_literal() -> None:
    assert Sentence("5 % of 100 %(x)s") == "5 % of 100 %(x)s"
    assert BRACKETS.translate_sentence(Sentence("")) == ""


def test_plain_text_is_not_translated() -> None:
    assert BRACKETS.translate_sentence("at the line") == "at the line"
    assert BRACKETS.translate_sentence(str(NESTED)) == str(NESTED)


def test_joined_sentences_are_translated_one_by_one() -> None:
    joined = join_sentences(Sentence("One."), "", "two", Sentence("Three."))
    assert joined == "One. two Three."
    assert "⟨One.⟩" in BRACKETS.translate_sentence(joined)
    assert "⟨Three.⟩" in BRACKETS.translate_sentence(joined)
    assert (join_sentences(), join_sentences("", "one")) == ("", "one")
    assert join_with_and([Sentence("a"), "b", "c"]) == "a and b and c"


@pytest.mark.parametrize(("template", "error"), [("%(x)s", KeyError), ("%(y)d", TypeError)])
def test_a_template_that_does_not_fit_its_values_is_an_error(template: str, error: type[Exception]) -> None:
    with pytest.raises(error):
        Sentence(template, y="text")


class _German(gettext.NullTranslations):
    def gettext(self, message: str) -> str:
        return {"It took %(t)g s.": "Es dauerte %(t)g s.", "In all": "In allen", "%(a)s: %(b)s": "%(a)s: %(b)s"}.get(
            message, message
        )


@pytest.mark.parametrize(
    ("sentence", "clause", "translation"),
    [
        (Sentence("It took %(t)g s.", t=2.0), "it took 2 s", "Es dauerte 2 s"),
        (Sentence("%(a)s: %(b)s", a=Sentence("In all"), b="Four."), "in all: Four", "In allen: Four"),
        (Sentence("%(a)s: %(b)s", a=2, b=3), "2: 3", "2: 3"),
        ("Plain text.", "plain text", "plain text"),
        ("", "", ""),
    ],
)
def test_a_clause_of_a_sentence_is_translated_as_that_sentence(sentence: str, clause: str, translation: str) -> None:
    made = make_clause(sentence)
    assert made == clause
    assert Language("de", _German()).translate_sentence(made) == translation
    assert drop_full_stop(sentence) == str(sentence).rstrip(".")
