"""Sentences are English text that can still be translated after pickling, copying and nesting."""

from __future__ import annotations

import copy
import gettext
import pickle

import pytest

from service.language import Language
from sim.sentences import Sentence, join_sentences, join_with_and


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
