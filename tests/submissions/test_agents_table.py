"""The [agents] table of an assignment and the agents' files in a submission: accepted and refused values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from sim.errors import AssignmentError, UsageError
from submissions.assignment.definition import Parts
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission
from submissions.stored_submission import pack_submission, unpack_submission

HEAD = """
id = "a"
title = "A"
[parts]
program = "student"
responder = "student"
{}
[[scenario]]
id = "s"
[[criterion]]
title = "Asks"
marks = 1
check = "messages"
agents = {}
at_least = 1
"""
PAIR = '["responder", "parser"]'


def written(folder: Path, text: str) -> Path:
    (folder / "assignment.toml").write_text(text)
    (folder / "given.py").write_text("def parser(text): return text")
    return folder


def test_agents_are_read_and_a_given_file_with_them(tmp_path: Path) -> None:
    table = '[agents]\nparser = "given.py"\nlogger = "student"\n'
    assignment = read_assignment(written(tmp_path, HEAD.format(table, PAIR)))
    assert assignment.parts.agents == {"logger": "student", "parser": "given.py"}
    assert assignment.given_parts["given.py"].startswith("def parser")


def test_an_agent_may_be_called_network(tmp_path: Path) -> None:
    pair = '["responder", "network"]'
    assignment = read_assignment(written(tmp_path, HEAD.format('[agents]\nnetwork = "student"\n', pair)))
    assert assignment.parts.agents == {"network": "student"}


@pytest.mark.parametrize(
    ("agents", "pair", "sentence"),
    [
        ('parser = "student"\nresponder = "student"', PAIR, '"responder" cannot be the name of an agent'),
        ('parser = "student"\nprint = "student"', PAIR, '"print" cannot be the name of an agent'),
        ('parser = "student"\nclass = "student"', PAIR, '"class" cannot be the name of an agent'),
        ('parser = "student"\n"../x" = "student"', PAIR, '"../x" cannot be the name of an agent'),
        ('parser = "nobody.py"', PAIR, 'parser is "nobody.py", expected "student" or a .py file beside this file'),
        ("parser = 3", PAIR, "parser is no text, expected"),
        ("\n".join(f'a{n} = "student"' for n in range(9)) + '\nparser = "student"', PAIR, "expected at most 8"),
        ('parser = "student"', '["robot", "parser"]', 'agents names "robot", expected parser, responder'),
        ('parser = "student"', '["parser"]', "agents is not a pair, expected [sender, receiver]"),
        ('parser = "student"', '["parser", "parser"]', "agents is not a pair"),
        ('parser = "student"', PAIR + "\njson = true", "has json beside agents"),
    ],
)
def test_a_mistake_is_named(agents: str, pair: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(AssignmentError) as error:
        read_assignment(written(tmp_path, HEAD.format(f"[agents]\n{agents}", pair)))
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ('responder = "none"', "agents needs a robot with a responder"),
        ('program = "given.py"\nresponder = "given.py"', "agents needs robot.py or responder.py from the student"),
    ],
)
def test_agents_need_somebody_who_asks_them(parts: str, sentence: str, tmp_path: Path) -> None:
    text = HEAD.format('[agents]\nparser = "student"\n', PAIR)
    text = text.replace('program = "student"\nresponder = "student"', parts)
    with pytest.raises(AssignmentError) as error:
        read_assignment(written(tmp_path, text))
    assert sentence in str(error.value)


def test_a_pair_without_agents_is_refused(tmp_path: Path) -> None:
    with pytest.raises(AssignmentError, match="expected an \\[agents\\] table with it"):
        read_assignment(written(tmp_path, HEAD.format("", PAIR)))


ASKED = Parts("given.py", agents={"agent": "given.py", "parser": "student"})
RESPONDER = "def responder(text): return parser(text)\n"
PARSER = "def parser(text): return text\n"


def folder(path: Path, files: Mapping[str, str]) -> Path:
    path.mkdir()
    for name, text in files.items():
        (path / name).write_text(text)
    return path


@pytest.mark.parametrize("names", [("responder.py", "parser.py"), ("answers.py", "Parser.py")])
def test_the_files_of_agents_are_no_parts(names: tuple[str, str], tmp_path: Path) -> None:
    files = dict(zip(names, (RESPONDER, PARSER), strict=True))
    submission = read_submission(folder(tmp_path / "ada", files), required_parts=ASKED)
    assert submission.program is None
    assert submission.responder is not None
    assert submission.responder.text == RESPONDER
    parser = submission.find_agent_code("parser")
    assert parser is not None
    assert (parser.name, parser.text) == (names[1], PARSER)
    assert submission.files_without(ASKED.agents) == {}
    assert unpack_submission(pack_submission(submission)).sha256 == submission.sha256
    assert not any("robot program" in note for note in submission.notes)


def test_a_missing_agent_is_named_and_one_too_many_left_out(tmp_path: Path) -> None:
    lone = folder(tmp_path / "ada", {"responder.py": RESPONDER})
    with pytest.raises(UsageError, match=r"has no parser\.py, expected a file for each agent"):
        read_submission(lone, required_parts=ASKED)
    full = {"responder.py": RESPONDER, "parser.py": PARSER, "agent.py": PARSER}
    submission = read_submission(folder(tmp_path / "bob", full), required_parts=ASKED)
    assert list(submission.files) == ["parser.py"]
    assert "agent.py was left out: the assignment provides this agent." in submission.notes
