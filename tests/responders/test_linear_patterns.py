"""Patterns that the worker applies to student texts outside all limits take linear time, whatever the text repeats."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import pytest

import responders
import service.similarity
import sim
import submissions
from responders import repeated_faults

_LENGTH = 60_000
#: Processor time for one text. A linear search takes at most a tenth of it, a quadratic one many times as long.
_SECONDS = 0.25
_PACKAGES = (responders, service.similarity, sim, submissions)
#: Modules that run in a child with limits, or read file names and texts of an assignment.
_OTHER_TEXTS = re.compile(r"responders\.(kit|library|sandbox\.inside)\b|submissions\.(assignment|criteria|downloads)\b")
#: Patterns for the first 200 characters of a line.
_BOUNDED = {"submissions.notebook._BEGIN"}
_ESCAPE = re.compile(r"\\[A-Za-z]")
_LETTERS = re.compile(r"[^\W\d]{2,}")
_FRAGMENTS = ("a", "1", " ", "\n", " \n", "'", '"', '"\\', "(", "[", "a.", "a ", "a,", "=", "-", "#", "%", "/*", "__")
_METHODS = "search|match|fullmatch|sub|findall|finditer|split"


@contextmanager
def _limit_cpu_seconds(seconds: float) -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _list_patterns() -> dict[str, tuple[re.Pattern[Any], tuple[str, ...]]]:
    """Return the patterns of the worker's modules by name, with the methods that their module calls."""
    patterns = {}
    for package in _PACKAGES:
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if _OTHER_TEXTS.match(info.name):
                continue
            module = importlib.import_module(info.name)
            for name, value in vars(module).items():
                if isinstance(value, re.Pattern):
                    methods = re.findall(rf"\b{name}\.({_METHODS})\b", inspect.getsource(module))
                    patterns[f"{info.name}.{name}"] = value, tuple(dict.fromkeys(methods)) or ("search",)
    return patterns


def _apply(pattern: re.Pattern[Any], method: str, text: str) -> None:
    data: Any = text.encode() if isinstance(pattern.pattern, bytes) else text
    if method == "sub":
        pattern.sub(data[:0], data)
    elif method == "finditer":
        for _ in pattern.finditer(data):
            pass
    else:
        getattr(pattern, method)(data)


PATTERNS = _list_patterns()


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(PATTERNS.keys() - _BOUNDED))
def test_pattern_takes_linear_time_on_repeated_fragments(name: str) -> None:
    pattern, methods = PATTERNS[name]
    source = pattern.pattern if isinstance(pattern.pattern, str) else pattern.pattern.decode()
    words = _LETTERS.findall(_ESCAPE.sub(" ", source))
    for fragment in dict.fromkeys((*_FRAGMENTS, *(word + end for word in words for end in ("", " ", "(")))):
        text = (fragment * _LENGTH)[:_LENGTH]
        for method in methods:
            try:
                with _limit_cpu_seconds(_SECONDS):
                    _apply(pattern, method, text)
            except TimeoutError:
                pytest.fail(f"{name}.{method} takes too long on {fragment!r} repeated")


def test_the_patterns_include_those_for_randomness() -> None:
    assert {"responders.repeated_faults._UNSAFE_NAMES", "service.similarity.tokens._TOKEN"} <= PATTERNS.keys()


@pytest.mark.parametrize("fragment", ["type(", "from a import ", "a\u0300\u0323", "\u0300\u0323", "ﷺ"])
def test_searching_a_text_for_randomness_takes_bounded_time(fragment: str) -> None:
    for length in (repeated_faults._MAX_CHARACTERS - 1, 20 * repeated_faults._MAX_CHARACTERS):
        with _limit_cpu_seconds(2):
            repeated_faults._may_use_chance({"text": (fragment * length)[:length]}, None)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("print(type(x))", False),
        ("type (x)", False),
        ("type('A', (), {})", True),
        ("type(\n'A', (), {})", True),
        ("type(*parts)", True),
        ("type(f(x))", True),
        ("ｅval('1')", True),
        ("äöü = 'ﬁ'", False),
        ("x = 1\n" * 40_000, True),
    ],
)
def test_texts_that_may_use_randomness(text: str, expected: bool) -> None:
    assert repeated_faults._may_use_chance({"text": text}, None) is expected
