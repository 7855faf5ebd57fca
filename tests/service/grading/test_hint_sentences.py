"""Hints can be translated: every text for people in their modules is a sentence, not plain English."""

import ast
import re
from collections.abc import Iterator
from importlib.resources import files

import pytest

from service.grading.hint_error_advice import ADVICE

_ADVICE_MODULE = "hint_error_advice.py"
_MODULES = sorted(
    each.name
    for each in files("service.grading").iterdir()
    if each.name.startswith("hint_") and each.name != _ADVICE_MODULE
)
#: Two words with a blank between them.
_PROSE = re.compile(r"[a-z]{2,} [a-z]{2,}")
#: Calls whose texts are translated, or are no texts for people.
_OTHER_CALLS = frozenset({"Sentence", "translatable", "compile", "findall", "fullmatch"})
#: Texts of Python, of cells and of the simulator, which the rules search for.
_SEARCHED_TEXTS = frozenset({"responder again", "image data logged...", "bound method", "image_data left"})
_SEARCHED_TEXTS |= {"undefined image data logged...", "second program", "out of range", "facing away"}


def _find_plain_texts(node: ast.AST) -> Iterator[str]:
    """Yield the English texts outside sentences, docstrings and patterns."""
    match node:
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in _OTHER_CALLS:
            for each in node.keywords:
                yield from _find_plain_texts(each.value)
            return
        case ast.Expr(value=ast.Constant()):
            return
        case ast.Constant(value=str() as text) if _PROSE.search(text) and text not in _SEARCHED_TEXTS:
            yield text
    for child in ast.iter_child_nodes(node):
        yield from _find_plain_texts(child)


@pytest.mark.parametrize("module", _MODULES)
def test_every_text_for_people_is_a_sentence(module: str) -> None:
    source = files("service.grading").joinpath(module).read_text("utf-8")
    assert not list(_find_plain_texts(ast.parse(source)))


def test_every_advice_on_an_error_is_marked_for_translation() -> None:
    tree = ast.parse(files("service.grading").joinpath(_ADVICE_MODULE).read_text("utf-8"))
    marked_texts = {
        each.args[0].value
        for each in ast.walk(tree)
        if isinstance(each, ast.Call) and isinstance(each.func, ast.Name) and isinstance(each.args[0], ast.Constant)
        if each.func.id == "translatable"
    }
    assert {advice for _, advice in ADVICE} == marked_texts
