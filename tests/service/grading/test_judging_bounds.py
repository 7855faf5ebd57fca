"""Hostile texts and faulty judges: judging takes proportionate time, and one failed criterion affects no other."""

from __future__ import annotations

import faulthandler
import os
import re
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from judging import START, criterion, recorded
from responders.source_file import SourceFile
from rows import quick_first
from service.grading.grade import CriterionResult, TrialResult
from service.grading.grader import grade
from service.grading.judging import limited_judging
from service.grading.judging.judge import judge, judge_one
from service.grading.judging.judge_declaration import StaticAnalysis
from service.grading.judging.limited_judging import JudgingLimits, compute_judging_limits, judge_within_limits
from service.grading.trial_runner import TrialRunner
from service.reports.plots.sequence import MAX_CALL_STEPS, Gap, build_conversation
from sim.errors import Cancelled, HostError
from sim.recording import Call, Image, Message, TimedText, Verdict
from submissions.assignment.definition import Assignment, Parts, Scenario, WorldSpec
from submissions.assignment.reader import read_assignment
from submissions.criteria import SCHEMAS, expressions
from submissions.criteria.expressions import check_pattern, has_match
from submissions.submission import Submission

pytestmark = pytest.mark.fast

#: The maximum length of a text over the wire, in characters.
_LONG = 60_000
_TEXTS: Mapping[str, Sequence[str]] = {
    "digits": ["1" * _LONG],
    "digits before a letter": ["1" * _LONG + "x"],
    "digits, point, digits, letter": ["1" * (_LONG // 2) + "." + "1" * (_LONG // 2) + "x"],
    "digits of another script": ["\u0661" * _LONG],
    "numbers without end": ["1e999 " * (_LONG // 6), "-1e-999 nan inf " * 100],
    "signs": ["-" * _LONG, "+-" * (_LONG // 2)],
    "points": ["1." * (_LONG // 2), "." * _LONG],
    "exponents": ["1e" * (_LONG // 2)],
    "number words": ["one hundred " * (_LONG // 12)],
    "nearly what is looked for": ["a " * (_LONG // 2), "a" * _LONG + "b"],
    "marks on a letter": ["e" + "\u0301" * _LONG],
    "letters that grow": ["\ufb03" * (_LONG // 3)],
    "spaces": [" \u2003\t" * (_LONG // 3)],
    "a deep answer": ["JSON::" + "[" * 30_000 + "]" * 30_000],
    "a great number": ["JSON::" + "9" * _LONG],
    "very many texts": ["0"] * 50_000,
}
_CRITERIA: Sequence[tuple[str, dict[str, Any]]] = [
    ("prints", {"equals": "x"}),
    ("prints", {"contains": "a" * 20 + "b", "ignore_case": True}),
    ("prints", {"matches": r"^(\w+\s?)+$"}),
    ("prints", {"matches": r"(a|a)+\Z", "ignore_case": True}),
    ("prints", {"in_order": [r"(\d+)+x", r"(.*)*y"], "compare": "matches"}),
    ("prints", {"in_order": ["0"] * 40, "only": True}),
    ("sequence", {"source": "print", "words": [["a", "1"], "1", "b"], "lead_in": True}),
    ("reports", {"expected": [[1, "a b", 2]], "among": ["a a a b", "c"]}),
    ("reports", {"expected": [["x y", 3]], "only": True, "source": "reply"}),
    ("events", {"events": [{"text": "a a b", "zone": [0, 0, 10, 10]}, {"text": "0", "zone": [0, 0, 10, 10]}]}),
    ("replies", {"is_json": True, "path": "a.0", "value": 1}),
    ("messages", {"json": True, "path": "0.0", "equals": "1"}),
    ("classification", {"answer": "shape", "labels": ["a", "one hundred one"]}),
]


@pytest.mark.parametrize("name", quick_first(_TEXTS, quick=2))
def test_hostile_texts_are_judged_in_little_time(name: str) -> None:
    texts = _TEXTS[name]
    lines = tuple(TimedText(3 * n / len(texts), text) for n, text in enumerate(texts))
    messages: list[Message] = []
    for line in lines:
        messages.append(Message(line.t, "robot", f"PY::{line.text}", line.t))
        messages.append(Message(line.t, "responder", line.text, line.t, len(messages) - 1))
    image = Image(0.0, 0, START, bytes(1600), bytes(1600), 0, "a")
    run = recorded(printed=lines, spoken=lines, messages=tuple(messages), images=(image,))
    for check, keys in _CRITERIA:
        begin = time.process_time()
        (result,) = judge(_asking(criterion(check, **keys)), _trials(run))
        # Quadratic time would be minutes here.
        assert time.process_time() - begin < 8, (check, keys)
        assert len(result.message) < 2000


def _asking(*criteria: Any) -> Assignment:
    return Assignment("a", "A", WorldSpec("Empty_Map"), Parts(), (Scenario("s", (START,)),), criteria)


def _trials(*recordings: Any) -> tuple[TrialResult, ...]:
    return tuple(TrialResult("s", n, 1, 0.0, 0.0, "visible", recording) for n, recording in enumerate(recordings))


_STORY = """
from ev3dev2.sound import Sound
{lines}
Sound().speak("end")
"""
#: Attempts of a student's program to affect the reader of its numbers and words.
_PROGRAMS = {
    "print and say digits": "print('1' * 20000 + 'x'); Sound().speak('1' * 20000 + 'x')",
    "say signs and points": "Sound().speak('-.' * 20000); print('.1' * 20000)",
    "print words that nearly match": "print('a' * 60000 + '!'); print(('a ' * 30000) + '!')",
    "log very long numbers": "print('Light_left: ' + '1' * 60000 + ' 0.' + '0' * 2000 + '1')",
    "print marks and joined letters": "print('e' + '\\u0301' * 60000); print('\\ufb03' * 20000)",
    "print very many short lines": "for n in range(90000): print('1 1')",
    "send what nests": "print('PY::JSON::' + '[' * 30000)",
}
_HARD_ASSIGNMENT = r"""
id = "hard"
title = "Hard to judge"
[parts]
responder = "echo.py"
[[scenario]]
id = "s"
poses = [[300, 300, 0]]
seconds = 60
[limits]
program_cpu = 20
[[criterion]]
id = "end"
title = "Says end"
marks = 1
check = "says"
equals = "end"
last = true
[[criterion]]
id = "pattern"
title = "Prints a word or some"
marks = 1
check = "prints"
matches = '^(\w+\s?)+$'
exactly = 0
[[criterion]]
id = "number"
title = "Says the width"
marks = 1
check = "reports"
expected = [[97.25, "wide"]]
only = true
[[criterion]]
id = "words"
title = "Counts"
marks = 1
check = "sequence"
source = "print"
words = ["1", "2", "3"]
lead_in = true
more = true
[[criterion]]
id = "log"
title = "Logs"
marks = 1
check = "datalog"
series = "Light_left"
measured = "left light"
[[criterion]]
id = "answers"
title = "Is answered"
marks = 1
check = "replies"
at_least = 0
is_json = true
path = "0.0"
"""


@pytest.mark.parametrize("name", quick_first(_PROGRAMS, quick=3))
def test_hostile_programs_are_graded_in_little_time(name: str, runner: TrialRunner, tmp_path: Path) -> None:
    (tmp_path / "assignment.toml").write_text(_HARD_ASSIGNMENT)
    (tmp_path / "echo.py").write_text("def responder(text):\n    return text[4:]\n")
    assignment = read_assignment(tmp_path)
    program = SourceFile("robot.py", _STORY.format(lines=_PROGRAMS[name]))
    begin = time.process_time()
    graded = grade(Submission("ada", program, None), assignment, runner=runner)
    assert time.process_time() - begin < 30
    assert graded.verdict in (Verdict.FINISHED, Verdict.PROTOCOL_ERROR)
    marks = {result.id: result.marks for result in graded.criteria}
    assert marks["end"] == 1
    assert marks["number"] == marks["words"] == marks["log"] == 0
    assert not any(result.unjudged for result in graded.criteria)


@pytest.mark.parametrize(
    ("pattern", "reason"),
    [
        ("(", "missing )"),
        (r"(?=a)b", "(?="),
        (r"(?<!a)b", "(?<"),
        (r"(a)\1", r"\1"),
        (r"(?P<n>a)(?P=n)", "(?P"),
        (r"(?>a)b", "(?>"),
        (r"a*+", "*+"),
        (r"a{1,2000}", "{1,2000}"),
        (r"((a{100}){100}){100}", "{100}"),
        (r"[\W\d]", r"\W in brackets"),
        (r"[\S]", r"\S in brackets"),
        (r"\u0041", r"\u"),
        (r"(?x)a b", "(?x"),
    ],
)
@pytest.mark.parametrize("key", ["matches", "in_order"])
def test_a_pattern_that_cannot_be_used_is_refused_with_its_line(
    pattern: str, reason: str, key: str, tmp_path: Path
) -> None:
    value = f"matches = '{pattern}'" if key == "matches" else f"in_order = ['{pattern}']\ncompare = \"matches\""
    text = _HARD_ASSIGNMENT.replace("matches = '^(\\w+\\s?)+$'\nexactly = 0", value)
    (tmp_path / "assignment.toml").write_text(text)
    (tmp_path / "echo.py").write_text("def responder(text): return text\n")
    with pytest.raises(Exception, match=r"assignment\.toml:\d+: .*expected one without look-around") as refused:
        read_assignment(tmp_path)
    assert reason in str(refused.value)


_PATTERNS = [
    r"^\d+$", r"\w", r"^\w+$", r"\W", r"^\s*$", r"\S\s\S", r"^(0|1|0?\.\d+|0\.\d+|1\.0+|\d\.\d+e-\d+)$", r"[a-z]",
    r"[^\d]x", r"[]a]", r"[^]a]b", r"[\]\d]$", r"a{,2}b", r"a.b", r"^.$", "a|^b|c$", r"(?i)é", r"\.", r"\\",
    r"\D\d", r"[\s\D]1", r"^(\w+\s?)+$", "GREY", r"(?m)^a$", r"(?s)a.b", r"b\Z", r"[a-c]\Z",
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("pattern", _PATTERNS)
@given(st.text(st.sampled_from("aAbBxéÉ١1.-_]\\ \n\t\u2003\x85e0²"), max_size=6), st.booleans())
def test_patterns_mean_what_they_mean_in_python(pattern: str, text: str, ignore_case: bool) -> None:
    flags = re.IGNORECASE if ignore_case else 0
    assert has_match(text, pattern, ignore_case) == bool(re.search(pattern, text, flags))


def test_the_very_end_is_told_from_the_end_of_a_line() -> None:
    assert has_match("ab", r"b\Z", False)
    assert not has_match("ab\ncd", r"b\Z", False)
    assert not has_match("ab\n", r"b\Z", False)
    assert has_match("ab\n", "b$", False)
    assert not has_match("ab\ncd", "b$", False)


def test_patterns_are_tried_on_what_is_no_text() -> None:
    assert has_match("a\ud800b", "^a.b$", False)
    assert not has_match("a" * 60_000 + "!", check_pattern(r"^(\w+\s?)+$"), False)


def test_a_pattern_that_repeats_too_much_is_refused() -> None:
    assert check_pattern(r"\w{40}")
    with pytest.raises(ValueError, match="repeats too much"):
        check_pattern(r"\w{300}")


@pytest.mark.parametrize("part", ["[", "[^", "[x", r"[\\"])
def test_a_class_without_an_end_is_searched_for_once(part: str) -> None:
    pattern = part * 100_000
    assert expressions._PART.findall("a" + pattern) == [pattern]
    with pytest.raises(ValueError, match="regular expression"):
        check_pattern(pattern)


def _sleeps() -> None:
    time.sleep(3600)


def _loops() -> None:
    while True:
        pass


def _eats() -> None:
    held = []
    while True:
        held.append(bytearray(8 << 20))


def _raises() -> None:
    raise ValueError("no number: 1e999")


def _recurses() -> None:
    _recurses()


def _aborts() -> None:
    faulthandler.disable()  # pytest's would report it
    os.abort()


def _leaves() -> None:
    os._exit(0)


def _is_killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _computes_in_c() -> None:
    sum(range(10**12))


#: Faults that stop any judge, and faults that only a separate process survives.
_ANYWHERE: Sequence[tuple[Callable[[], None], str]] = [
    (_sleeps, "it took more than 2 s"),
    (_loops, "it took more than 1 s of computing"),
    (_eats, "it used more than 64 MB of memory"),
    (_raises, "ValueError: no number: 1e999"),
    (_recurses, "RecursionError"),
]
_APART: Sequence[tuple[Callable[[], None], str]] = [
    (_aborts, "its process was ended by signal 6"),
    (_leaves, "its process ended before it was judged"),
    (_is_killed, "its process was ended by signal 9"),
    (_computes_in_c, "it took more than 1 s of computing"),
]
_LITTLE = recorded(printed=(TimedText(0.0, "x"),))
_MUCH = recorded(printed=(TimedText(0.0, "x"), TimedText(0.1, "y" * 100_000)))
_SMALL = JudgingLimits(1.0, 60.0, 64 << 20)


def _criteria(*ids: str) -> Assignment:
    made = (SCHEMAS["prints"].model_validate({"id": n, "title": n, "marks": 2, "check": "prints", "contains": "x"})
            for n in ids)  # fmt: skip
    return _asking(*made)


def _spoil(monkeypatch: pytest.MonkeyPatch, spoilt: Mapping[str, Callable[[], None]]) -> None:
    def judge_or_not(criterion: Any, *rest: Any) -> CriterionResult:
        if criterion.id in spoilt:
            spoilt[criterion.id]()
        return judge_one(criterion, *rest)

    monkeypatch.setattr(limited_judging, "judge_one", judge_or_not)
    monkeypatch.setattr(limited_judging, "_SMALL_LIMITS", replace(_SMALL, cpu_seconds=0.2, seconds=0.5))


def _children() -> set[str]:
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


@pytest.mark.long
@pytest.mark.parametrize(
    ("misbehave", "cause", "run"),
    [
        *((*each, "little") for each in _ANYWHERE),
        *((*each, "much") for each in _APART),
        *(pytest.param(*each, "much", marks=pytest.mark.long) for each in _ANYWHERE),
    ],
)
def test_a_criterion_that_cannot_be_judged_spoils_no_other(
    monkeypatch: pytest.MonkeyPatch, misbehave: Callable[[], None], cause: str, run: str
) -> None:
    _spoil(monkeypatch, {"bad": misbehave})
    trials = _trials(_LITTLE if run == "little" else _MUCH)
    bounds = replace(_SMALL, seconds=2.0) if misbehave is _sleeps else _SMALL
    before, bad, after = judge_within_limits(bounds, _criteria("before", "bad", "after"), trials, StaticAnalysis())
    assert [result.marks for result in (before, bad, after)] == [2, 0, 2]
    assert bad.max_marks == 2
    assert bad.message == "This criterion could not be judged. Staff will review it."
    assert bad.unjudged.startswith(cause)
    assert bad.for_staff == f"Could not be judged: {bad.unjudged}."
    assert not before.unjudged
    assert not after.unjudged
    assert [signal.getsignal(number) for number in (signal.SIGPROF, signal.SIGALRM)] == [signal.SIG_DFL] * 2
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_many_misbehave_and_each_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    _spoil(monkeypatch, {"a": _raises, "c": _aborts, "d": _eats, "e": _is_killed})
    results = judge_within_limits(_SMALL, _criteria(*"abcdef"), _trials(_MUCH), StaticAnalysis())
    assert [result.id for result in results] == list("abcdef")
    assert [bool(result.unjudged) for result in results] == [True, False, True, True, True, False]


def test_a_rank_of_what_could_not_be_judged_is_not_judged_either(monkeypatch: pytest.MonkeyPatch) -> None:
    lap = SCHEMAS["finishes"].model_validate({"id": "lap", "title": "L", "marks": 2, "check": "finishes"})
    rank = criterion("ranking", of="lap", measure="time", steps=[[50, 1.0]])
    _spoil(monkeypatch, {"lap": _raises})
    ranked, _ = judge_within_limits(_SMALL, _asking(rank, lap), _trials(_LITTLE), StaticAnalysis())
    assert ranked.marks == 0
    assert ranked.unjudged == "lap, which it needs, could not be judged"


def test_what_comes_back_is_what_was_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """The result is the same through a process, with the recordings' own images."""
    messages = (Message(0, "robot", "IMG_DATA::{}", 0), Message(0, "responder", "a", 0.1, 0))
    images = tuple(Image(n / 2, 15 * n, START, bytes([n]) * 1600, bytes(1600), 0, "a") for n in range(3))
    run = recorded(messages=messages, images=images)
    rule = _asking(criterion("classification", labels=["a"]))
    plain = judge(rule, _trials(run))
    monkeypatch.setattr(limited_judging, "_SMALL_INPUT", -1)
    apart = judge_within_limits(_SMALL, rule, _trials(run), StaticAnalysis())
    assert apart == plain
    assert [prediction.image is image for prediction, image in zip(apart[0].predictions, images, strict=True)] == [
        True
    ] * 3


def test_what_a_machine_spoilt_is_not_judged() -> None:
    with pytest.raises(HostError, match="has to be run again"):
        judge_within_limits(_SMALL, _criteria("a"), _trials(recorded(verdict=Verdict.HOST_ERROR)), StaticAnalysis())


def test_whoever_waits_may_stop_the_judging(monkeypatch: pytest.MonkeyPatch) -> None:
    _spoil(monkeypatch, {"bad": _sleeps})

    def heartbeat() -> None:
        raise Cancelled("no longer ours")

    before = _children()
    with pytest.raises(Cancelled):
        judge_within_limits(_SMALL, _criteria("bad"), _trials(_MUCH), StaticAnalysis(), heartbeat)
    assert _children() == before


def test_bounds_grow_with_what_there_is_to_judge() -> None:
    one, many = compute_judging_limits(_trials(_LITTLE)), compute_judging_limits(_trials(*[_LITTLE] * 500))
    assert 10 < one.cpu_seconds < 20
    assert many.cpu_seconds > 500


def test_a_grade_says_that_staff_have_to_look(
    monkeypatch: pytest.MonkeyPatch, runner: TrialRunner, tmp_path: Path
) -> None:
    _spoil(monkeypatch, {"number": _raises})
    (tmp_path / "assignment.toml").write_text(_HARD_ASSIGNMENT)
    (tmp_path / "echo.py").write_text("def responder(text):\n    return text\n")
    program = SourceFile("robot.py", _STORY.format(lines="print('1 2 3!')"))
    graded = grade(Submission("ada", program, None), read_assignment(tmp_path), runner=runner)
    assert graded.notes == ("1 of 6 criteria could not be judged; staff will review them",)
    assert {result.id: result.marks for result in graded.criteria} | {"number": 0} == {
        "end": 1, "pattern": 1, "number": 0, "words": 1, "log": 0, "answers": 1,
    }  # fmt: skip
    assert graded.marks == Decimal(4)


def test_of_one_message_only_the_first_calls_are_drawn() -> None:
    calls = tuple(Call(0, n % 1000, "responder", "parser", "a", "b") for n in range(10_000))
    message = build_conversation(recorded(messages=(Message(0, "robot", "PY::0", 0),), calls=calls))
    assert len(message.steps) < MAX_CALL_STEPS + 5
    assert sum(step.count for step in message.steps if isinstance(step, Gap)) == 20_000 - MAX_CALL_STEPS
