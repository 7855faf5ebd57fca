"""Identical behaviour of robots counts if few of many have it, and if no limit of the host ended the trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

import report_builders
from responders.source_file import SourceFile
from service.grading.grade import TrialResult
from service.similarity.behaviour import (
    MIN_STUDENTS,
    SharedBehaviour,
    TrialName,
    extract_behaviour,
    find_shared_behaviour,
)
from service.similarity.pairs import compare_submissions
from service.similarity.similar_sources import build_source
from sim.recording import Fault, Message, Recording, TimedText, Verdict
from submissions.submission import Submission

STILL = replace(report_builders.line_follower_recording(0), printed=(), spoken=())


def trials(*recordings: Recording) -> list[TrialResult]:
    return [TrialResult("line", place, place, 10.0, 0.0, "visible", each) for place, each in enumerate(recordings)]


def record_speech(text: str) -> Recording:
    return replace(STILL, printed=(TimedText(0.1, text),), messages=(Message(0.1, "robot", text, 0.2),))


def same(of_students: Sequence[Sequence[Recording]]) -> dict[tuple[str, str], tuple[SharedBehaviour, ...]]:
    return find_shared_behaviour(
        {f"s{number:02}": extract_behaviour(trials(*each)) for number, each in enumerate(of_students)}
    )


def driven(ticks: int) -> Recording:
    return replace(report_builders.line_follower_recording(ticks), printed=(), spoken=())


def test_a_path_that_only_two_drove_is_named_with_its_trial() -> None:
    pairs = same([[driven(30)], [driven(30)], *([driven(31 + number)] for number in range(8))])
    assert pairs == {("s00", "s01"): (SharedBehaviour(TrialName("line", 0, True), "path", 2, 10),)}


def test_a_path_that_many_drove_says_nothing() -> None:
    assert same([[driven(30)]] * 10) == {}
    assert same([[driven(30)]] * 3 + [[driven(31 + number)] for number in range(9)]) == {}


def test_of_few_students_nothing_is_said() -> None:
    alone = [[driven(31 + number)] for number in range(MIN_STUDENTS - 3)]
    assert same([[driven(30)], [driven(30)], *alone]) == {}
    assert same([[driven(30)], [driven(30)], *alone, [driven(90)]]) != {}


def test_messages_and_faults_are_compared_by_themselves() -> None:
    fault = Fault(0.5, Verdict.PROGRAM_ERROR, "program", "NameError: name 'mottor' is not defined", 3)
    failed = replace(driven(20), verdict=Verdict.PROGRAM_ERROR, faults=(fault,))
    alone = [[record_speech(f"mine {number}")] for number in range(8)]
    ours, theirs = replace(record_speech("PY::1"), faults=(fault,), verdict=Verdict.PROGRAM_ERROR), failed
    (both,) = same([[ours], [theirs], *alone]).values()
    assert [each.aspect for each in both] == ["faults"]
    (both,) = same([[record_speech("PY::1")], [record_speech("PY::1")], *alone]).values()
    assert [each.aspect for each in both] == ["messages"]


def test_who_did_nothing_did_nothing_the_same() -> None:
    assert same([[STILL], [STILL], *([driven(31 + number)] for number in range(8))]) == {}


@pytest.mark.parametrize("verdict", [Verdict.CPU_LIMIT, Verdict.STALLED])
def test_a_trial_that_the_machine_cut_is_not_compared(verdict: Verdict) -> None:
    cut = replace(driven(30), verdict=verdict)
    assert same([[cut], [cut], *([driven(31 + number)] for number in range(8))]) == {}


def test_robots_alone_make_a_pair_only_where_they_did_the_same_often() -> None:
    submitted = {
        f"s{number:02}": Submission(f"s{number:02}", SourceFile("robot.py", "x = 1\n")) for number in range(10)
    }
    sources = [build_source(student, "robot.py", "x = 1\n") for student in submitted]

    def pairs(*shared: int) -> list[tuple[str, str]]:
        own = [[driven(40 + 9 * number + trial) for trial in range(4)] for number in range(10)]
        for trial in shared:
            own[1][trial] = own[0][trial]
        behaviours = {student: extract_behaviour(trials(*each)) for student, each in zip(submitted, own, strict=True)}
        return [pair.students for pair in compare_submissions("line", sources, (), behaviours).pairs]

    assert pairs(0) == []
    assert pairs(0, 2) == [("s00", "s01")]
