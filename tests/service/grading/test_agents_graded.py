"""Grading with agents: who is at fault, and how criteria and reports use the messages between agents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from notebook_builder import notebook
from responders.source_file import SourceFile
from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.judging.judge import judge
from service.grading.run_plan import plan_run
from service.grading.static_analysis import to_json_trial
from service.grading.trial_runner import TrialRunner
from service.reports.faults import group_faults
from service.reports.formats.json_output import build_json_document
from service.reports.page import build_page
from service.reports.plots.sequence import Step, build_conversation
from service.reports.view import build_staff_view
from service.store.grades.recordings import encode_within_limit, from_bytes, to_bytes
from sim.errors import UsageError
from sim.recording import AgentMessage, AgentOutput, Verdict
from submissions.assignment.definition import Assignment
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.bundle import read_submission
from submissions.criteria import SCHEMAS
from submissions.submission import Submission

ASSIGNMENT = find_assignment("parser-agent-and-logger")
REFERENCE = read_submission(locate_examples(ASSIGNMENT.id) / "reference", required_parts=ASSIGNMENT.parts)


@pytest.fixture(scope="module")
def full(runner: TrialRunner) -> Grade:
    return grade(REFERENCE, ASSIGNMENT, runner=runner)


def with_given_parser(text: str) -> Assignment:
    parts = replace(ASSIGNMENT.parts, agents=MappingProxyType({**ASSIGNMENT.parts.agents, "parser": "given.py"}))
    return replace(ASSIGNMENT, parts=parts, given_parts={**ASSIGNMENT.given_parts, "given.py": text})


@pytest.mark.parametrize(
    ("parser", "verdict", "words"),
    [
        (
            "def parser(text) return text",
            Verdict.ASSIGNMENT_ERROR,
            "the given agent parser cannot be used: SyntaxError",
        ),
        ("def parser(text): return text", Verdict.FINISHED, ""),
        # A student's own message may have caused it.
        ("def parser(text): return text / 1", Verdict.RESPONDER_ERROR, "gave no answer: TypeError: unsupported"),
    ],
)
def test_a_given_agents_mistake_is_the_instructors(
    parser: str, verdict: Verdict, words: str, runner: TrialRunner
) -> None:
    result = grade(REFERENCE, with_given_parser(parser), runner=runner)
    recording = result.trials[0].recording
    assert result.verdict is verdict
    assert words in "".join([*recording.notes, *(fault.message for fault in recording.faults)])
    assert [fault.agent for fault in recording.faults if fault.verdict is Verdict.RESPONDER_ERROR][:1] in (
        [],
        ["agent"],
    )


def test_a_given_agent_sees_given_files_alone_and_no_process_sees_anothers_text() -> None:
    given = replace(with_given_parser("x = 1"), given=MappingProxyType({"table.csv": b"1"}))
    submission = replace(REFERENCE, files=MappingProxyType({**REFERENCE.files, "own.csv": b"2"}))
    plan = plan_run(submission, given)
    assert sorted(plan.agents["parser"].files) == ["table.csv"]
    assert sorted(plan.agents["agent"].files) == ["own.csv", "table.csv"]
    assert plan.responder is not None
    assert sorted(plan.responder.files) == ["own.csv", "table.csv"]


def as_notebook(folder: Path, *first: str, leave_out: str = "") -> Submission:
    """Return the reference as a notebook: each agent in a cell that writes its file, the responder in the last cell."""
    sources = {
        path.name: path.read_text() for path in sorted((locate_examples(ASSIGNMENT.id) / "reference").glob("*.py"))
    }
    responder = sources.pop("responder.py")
    sources.pop(leave_out, None)
    agents = [f"%%writefile {name}\n{text}" for name, text in sources.items()]
    return read_submission(
        notebook(folder / "ada.ipynb", [*first, *agents, responder]), required_parts=ASSIGNMENT.parts
    )


def test_a_notebook_brings_agents_in_cells_and_gets_the_marks_of_the_files(
    tmp_path: Path, full: Grade, runner: TrialRunner
) -> None:
    result = grade(as_notebook(tmp_path), ASSIGNMENT, runner=runner)
    assert result.marks == full.marks == ASSIGNMENT.max_marks
    expected, recording = full.trials[0].recording, result.trials[0].recording
    assert recording.agent_messages == expected.agent_messages
    assert [each.log for each in recording.agent_outputs] == [each.log for each in expected.agent_outputs]


def test_what_cells_ask_agents_before_the_marked_run_is_no_part_of_it(
    tmp_path: Path, full: Grade, runner: TrialRunner
) -> None:
    submission = as_notebook(tmp_path, "print(agent('PY::7'), parser('PY::8'))")
    result = grade(submission, ASSIGNMENT, runner=runner)
    recording = result.trials[0].recording
    assert "Py saw: 7 8" in recording.responder_output
    assert result.marks == ASSIGNMENT.max_marks
    assert recording.agent_messages == full.trials[0].recording.agent_messages


def test_a_notebook_without_one_of_the_agents_is_told_where_to_put_it(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"has no parser\.py; put each agent .* begins with %%writefile parser\.py"):
        as_notebook(tmp_path, leave_out="parser.py")


def judged(full: Grade, check: str, **keys: Any) -> tuple[bool, str]:
    table = {"id": "c", "title": "C", "marks": "1", "check": check, **keys}
    criterion = replace(ASSIGNMENT, criteria=(SCHEMAS[check].model_validate(table),))
    (result,) = judge(criterion, full.trials)
    return result.marks == 1, result.message


@pytest.mark.parametrize(
    ("check", "keys", "passes", "words"),
    [
        ("messages", {"agents": ["responder", "agent"], "exactly": 4}, True, "The responder told the agent"),
        (
            "messages",
            {"agents": ["agent", "responder"], "last": True, "contains": "my"},
            True,
            "The last text that the",
        ),
        ("messages", {"agents": ["parser", "logger"], "at_least": 1}, False, "it told the logger nothing"),
        ("messages", {"equals": "PY::0", "exactly": 1}, True, "The robot sent"),
        (
            "replies",
            {"agents": ["responder", "logger"], "at_least": 4, "matches": "^[1-4]$"},
            True,
            "The logger answered",
        ),
        ("replies", {"agents": ["responder", "logger"], "equals": "1"}, False, "(1 of 4 answered as expected)"),
        ("replies", {"agents": ["agent", "parser"], "expect": {"PY::0": 0}}, True, "The parser answered 1 of 1"),
        ("replies", {"agents": ["agent", "parser"], "expect": {"PY::0": "0"}}, False, 'but it answered "0"'),
        ("replies", {"agents": ["agent", "parser"], "expect": {"PY::5": 5}}, False, "but it was not"),
        ("replies", {"agents": ["logger", "parser"]}, False, "of the logger's messages, but none reached it"),
    ],
)
def test_criteria_look_at_a_pair_of_agents(
    check: str, keys: dict[str, Any], passes: bool, words: str, full: Grade
) -> None:
    passed, message = judged(full, check, **keys)
    assert passed is passes, message
    assert words in message


def test_what_agents_say_is_in_reports_and_exports(full: Grade) -> None:
    recording = full.trials[0].recording
    page = build_page(build_staff_view(full), REFERENCE)
    scene = page.scenes[0]
    assert [line.sender for line in scene.messages[:4]] == [
        "robot",
        "responder → agent",
        "agent → parser",
        "parser → agent",
    ]
    outputs = {each.title: each.text for each in scene.outputs}
    assert "Received message: PY::0" in outputs["Log file of the agent logger (logger.txt)"]
    (trial,) = build_json_document(build_staff_view(full))["trials"]
    assert trial["agent_messages"][2]["text"] == "0"
    assert len(to_json_trial(full.trials[0])["agent_messages"]) == len(recording.agent_messages) == 24
    conversation = build_conversation(recording)
    assert conversation.parties == ("robot", "responder", "parser", "agent", "logger")
    first = [(step.source, step.target, step.kind) for step in conversation.steps[:4] if isinstance(step, Step)]
    assert first == [
        ("robot", "responder", "message"),
        ("responder", "agent", "call"),
        ("agent", "parser", "call"),
        ("parser", "agent", "return"),
    ]


def test_an_agent_of_any_name_has_a_lane(full: Grade) -> None:
    recording = full.trials[0].recording
    message = AgentMessage(0.0, "responder", "translator", "PY::0", 0)
    other = replace(recording, agent_messages=(message,), agent_outputs=(AgentOutput("translator", "", ""),))
    assert build_conversation(other).parties == ("robot", "responder", "translator")


def test_a_fault_is_told_with_the_agents_own_line(runner: TrialRunner) -> None:
    files = {**REFERENCE.files, "parser.py": b"def parser(text):\n    return 1 / 0\n"}
    submission = replace(REFERENCE, files=MappingProxyType(files))
    result = grade(submission, ASSIGNMENT, runner=runner)
    group = group_faults(result, submission)[0]
    assert group.where == "Agent parser (parser.py), line 2"
    assert [line.text for line in group.excerpt if line.marked] == ["    return 1 / 0"]
    assert "One of your agents raised an error" in build_page(build_staff_view(result), submission).words.happened


def test_recordings_with_agents_are_kept_and_cut_like_others(full: Grade) -> None:
    recording = full.trials[0].recording
    again = from_bytes(to_bytes(recording))
    assert again.agent_messages == recording.agent_messages
    assert again.agent_outputs == recording.agent_outputs
    flood = tuple(replace(recording.agent_messages[0], text=f"{n:x}" * 40) for n in range(20_000))
    outputs = tuple(replace(each, log="".join(map(str, range(200_000)))) for each in recording.agent_outputs)
    cut = encode_within_limit(replace(recording, agent_messages=flood, agent_outputs=outputs), 60_000).recording
    assert len(cut.agent_messages) < 20_000
    assert all(len(each.log) <= 2000 for each in cut.agent_outputs)
    assert cut.sha256 == recording.sha256


def test_avoided_modules_are_avoided_by_agents_too() -> None:
    avoids = SCHEMAS["source"].model_validate(
        {"id": "s", "title": "S", "marks": "1", "check": "source", "part": "responder", "avoids": ["import sklearn"]}
    )
    plan = plan_run(REFERENCE, replace(ASSIGNMENT, criteria=(*ASSIGNMENT.criteria, avoids)))
    assert {name: each.limits.excluded_modules for name, each in plan.agents.items()} == dict.fromkeys(
        plan.agents, ("sklearn",)
    )


def test_a_submission_without_an_agent_is_refused(tmp_path: Path) -> None:
    files = {name: data for name, data in REFERENCE.files.items() if name != "logger.py"}
    lacking = Submission("ada", responder=SourceFile("responder.py", "x = 1"), files=MappingProxyType(files))
    with pytest.raises(UsageError, match=r"no agent logger; parser-agent-and-logger requires logger\.py"):
        plan_run(lacking, ASSIGNMENT)
