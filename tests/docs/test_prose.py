"""The documents and docstrings are in plain English: turns of phrase that other documentation does not use are rare."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from paths import ROOT

#: The most occurrences in 1000 words.
_MOST = 1.0
_ODD = {
    "clause as a subject": r"(?:^|(?<=[.:;!] ))(?:What|Who|Whoever|Whose|Where|Which) [^.?;]{3,}[.;]",
    "uncommon verb": r"\b(?:mends?|mended|let in|lets them in|taken? out of|hand(?:s|ed)? (?:in|over)|go(?:es)? on|"
    r"stands? (?:beside|there|until)|be had|in vain|is told|are told|tells of|holds for)\b",
    "uncommon pronoun": r"\b(?:[Nn]obody|[Ss]omebody|[Ww]hoever|of one's own|is so)\b",
}
#: Folders of files that are given to students, some of them with magic lines.
_GIVEN = {"catalogue", "template"}
_PACKAGES = ("sim", "models", "submissions", "responders", "service", "robomark")
_DOCUMENTS = [*ROOT.glob("docs/**/*.md"), *ROOT.glob("*.md")]


def _prose(markdown: str) -> str:
    """Return the paragraphs and list items of a document, without code, tables, links and headings."""
    text = re.sub(r"```.*?```", "\n", markdown, flags=re.DOTALL)
    text = re.sub(r"(?m)^(?:\||#).*$", "", text)
    text = re.sub(r"`[^`\n]*`", "X", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"(?m)^[\s>*+-]+", "", text)
    return re.sub(r"(?<!\n)\n(?!\n)", " ", text)


def _docstrings(package: str) -> Iterator[str]:
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for file in sorted((ROOT / package).rglob("*.py")):
        if not _GIVEN & set(file.parts):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, documented) and (text := ast.get_docstring(node)):
                    yield re.sub(r"``[^`]*``", "X", text)


def _find_odd_phrases(texts: Sequence[str]) -> tuple[float, list[str]]:
    """Return the occurrences in 1000 words, and the phrases."""
    words = sum(len(text.split()) for text in texts)
    phrases = [match[0] for text in texts for odd in _ODD.values() for match in re.finditer(odd, text, re.MULTILINE)]
    return 1000 * len(phrases) / words, phrases


@pytest.mark.parametrize("document", _DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_document_is_in_plain_english(document: Path) -> None:
    share, phrases = _find_odd_phrases([_prose(document.read_text())])
    assert share <= _MOST, phrases


@pytest.mark.parametrize("package", _PACKAGES)
def test_docstrings_are_in_plain_english(package: str) -> None:
    share, phrases = _find_odd_phrases(list(_docstrings(package)))
    assert share <= _MOST, phrases[:40]


@pytest.mark.parametrize(
    "text",
    ["What cannot be read is refused.", "The worker goes on.", "A file of one's own.", "Nobody may read it."],
)
def test_such_a_phrase_is_found(text: str) -> None:
    assert _find_odd_phrases([f"Words before it. {text}"])[1]
