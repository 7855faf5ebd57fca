"""Storage of the translatable sentences of a grade beside its English texts.

A grade's columns contain English texts. One column lists the templates and values of those that can be translated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from service.grading.grade import Grade, convert_texts
from sim.sentences import Sentence


def encode_sentences(grade: Grade) -> list[Any]:
    """Return the different translatable sentences of a grade, each as ``[template, values]``.

    Left out are those whose values can't be stored as JSON without a change of their text.
    """
    sentences: dict[str, Sentence] = {}

    def collect(text: str) -> str:
        if isinstance(text, Sentence):
            sentences.setdefault(str(text), text)
        return text

    convert_texts(grade, collect)
    encoded_sentences = [(text, _encode_sentence(sentence)) for text, sentence in sentences.items()]
    return [encoded for text, encoded in encoded_sentences if _decode_text(encoded) == text]


def restore_sentences(grade: Grade, encoded_sentences: Sequence[Any]) -> Grade:
    """Return the grade with its texts as the sentences they were when it was stored."""
    decoded_sentences = (_decode_sentence(each) for each in encoded_sentences)
    sentences = {str(each): each for each in decoded_sentences}
    return convert_texts(grade, lambda text: sentences.get(text, text)) if sentences else grade


def _encode_sentence(sentence: Sentence) -> list[Any]:
    return [sentence.template, {name: _encode_value(value) for name, value in sentence.values.items()}]


def _encode_value(value: object) -> object:
    match value:
        case Sentence():
            return {"sentence": _encode_sentence(value)}
        case str() | bool() | int() | None:
            return value
        case float() if math.isfinite(value):  # JSON has no others
            return float(value)  # numpy's floats too
    return str(value)


def _decode_sentence(encoded_sentence: Sequence[Any]) -> Sentence:
    template, values = encoded_sentence
    return Sentence(template, **{name: _decode_value(value) for name, value in values.items()})


def _decode_value(value: object) -> object:
    return _decode_sentence(value["sentence"]) if isinstance(value, Mapping) else value


def _decode_text(encoded_sentence: Sequence[Any]) -> str | None:
    try:
        return str(_decode_sentence(encoded_sentence))
    except TypeError:  # a format for numbers, and a value that was stored as text
        return None
