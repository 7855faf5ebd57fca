"""Original downloads of Moodle, Gradescope and nbgrader: the owner of each file; no student is lost or misnamed."""

from __future__ import annotations

import resource
from collections.abc import Mapping
from pathlib import Path

import pytest

from builders import read_named_batch
from sim.errors import UsageError
from submissions.batch_folder import BatchContents
from submissions.downloads import parse_moodle_number
from submissions.student_identity import People, read_people
from zips import zipped

ASSIGNMENT = "echo-responder"
ROBOT = "print('hello')\n"
RESPONDER = "def responder(msg):\n    return msg\n"
BOTH = {"robot.py": ROBOT, "responder.py": RESPONDER}
PEOPLE = """\
Identifier,Full name,ID number,Email address,Status,Grade
Participant 500000,Ada Lovelace,s1,ada@uni.example,Submitted,
Participant 500001,Alan Turing,s2,alan@uni.example,Submitted,
Participant 500002,Mary-Ann O'Neil,s3,mary@uni.example,Submitted,
Participant 500003,Ada Lovelace,s4,ada2@uni.example,Submitted,
"""


def laid(folder: Path, files: Mapping[str, str | bytes]) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def under(folder: str, files: Mapping[str, str | bytes] = BOTH) -> dict[str, str | bytes]:
    return {f"{folder}{name}": content for name, content in files.items()}


def people(tmp_path: Path, text: str = PEOPLE) -> People:
    (tmp_path / "people.csv").write_text(text, encoding="utf-8")
    return read_people(tmp_path / "people.csv")


def taken(contents: BatchContents) -> dict[str, str]:
    """Return name by id of all accepted students."""
    return {request.submission.student: request.student.name for request in contents.grading_requests}


def refused(contents: BatchContents) -> dict[str, str]:
    return {refusal.student.id or refusal.source: refusal.reason for refusal in contents.refusals}


MOODLE = {
    "folders": {
        **under("Ada Lovelace_500000_assignsubmission_file_/"),
        **under("Alan Turing_500001_assignsubmission_file/", {"work.zip": zipped(BOTH), "report.pdf": "x"}),
        **under("Mary-Ann O'Neil_500002_assignsubmission_file/"),
        "Mary-Ann O'Neil_500002_assignsubmission_onlinetext/onlinetext.html": "<p>see the files</p>",
    },
    "flat": {
        **under("Ada Lovelace_500000_assignsubmission_file_"),
        **under("Alan Turing_500001_assignsubmission_file_", {"a_1_b.zip": zipped(BOTH)}),
        **under("Mary-Ann O'Neil_500002_assignsubmission_file_"),
        "Mary-Ann O'Neil_500002_assignsubmission_onlinetext_onlinetext.html": "<p>see the files</p>",
    },
    "groups": {
        **under("Group 1-Ada Lovelace_500000_assignsubmission_file_/"),
        **under("Lab group A2-Alan Turing_500001_assignsubmission_file_/"),
        **under("Default group-Mary-Ann O'Neil_500002_assignsubmission_file_/"),
    },
}


@pytest.mark.parametrize("shape", MOODLE)
@pytest.mark.parametrize("as_zip", [False, True])
def test_moodles_download_names_each_student_once(tmp_path: Path, shape: str, as_zip: bool) -> None:
    path = laid(tmp_path / "download", MOODLE[shape])
    if as_zip:
        path = tmp_path / "download.zip"
        path.write_bytes(zipped(MOODLE[shape]))
    contents = read_named_batch(path, ASSIGNMENT)
    assert refused(contents) == {}
    assert taken(contents) == {name: name for name in ("Ada Lovelace", "Alan Turing", "Mary-Ann O'Neil")}
    numbers = sorted(parse_moodle_number(request.source) for request in contents.grading_requests)
    assert numbers == ["500000", "500001", "500002"]
    assert all(request.submission.responder is not None for request in contents.grading_requests)
    known = read_named_batch(path, ASSIGNMENT, people(tmp_path))
    assert taken(known) == {"s1": "Ada Lovelace", "s2": "Alan Turing", "s3": "Mary-Ann O'Neil"}
    assert "ada@uni.example" in {request.student.email for request in known.grading_requests}


def test_two_of_one_name_have_their_numbers_beside_it(tmp_path: Path) -> None:
    names = ("Ada Lovelace_500000", "Ada Lovelace_500003", "Alan Turing_500001")
    files = {key: value for name in names for key, value in under(f"{name}_assignsubmission_file_/").items()}
    path = laid(tmp_path / "download", files)
    assert taken(read_named_batch(path, ASSIGNMENT)) == {
        "Ada Lovelace (500000)": "Ada Lovelace",
        "Ada Lovelace (500003)": "Ada Lovelace",
        "Alan Turing": "Alan Turing",
    }
    assert list(taken(read_named_batch(path, ASSIGNMENT, people(tmp_path)))) == ["s1", "s4", "s2"]


def test_blind_marking_knows_numbers_alone(tmp_path: Path) -> None:
    names = ("Participant_500000", "Participant_500001")
    files = {key: value for name in names for key, value in under(f"{name}_assignsubmission_file_/").items()}
    path = laid(tmp_path / "download", files)
    assert taken(read_named_batch(path, ASSIGNMENT)) == {"Participant 500000": "", "Participant 500001": ""}
    assert list(taken(read_named_batch(path, ASSIGNMENT, people(tmp_path)))) == ["s1", "s2"]


def test_nobody_is_taken_for_another(tmp_path: Path) -> None:
    files = {
        **under("Alan Turing_500000_assignsubmission_file_/"),  # Ada's number: the table belongs to another assignment
        **under("Ada Lovelace_9_assignsubmission_file_/"),  # a number not in the table, and two students of that name
        **under("Alan Turin_8_assignsubmission_file_/"),
        "Eve Adams_7_assignsubmission_onlinetext/onlinetext.html": "<p>print('hello')</p>",
    }
    contents = read_named_batch(laid(tmp_path / "download", files), ASSIGNMENT, people(tmp_path))
    assert taken(contents) == {}
    reasons = refused(contents)
    assert "has Ada Lovelace as Participant 500000, not Alan Turing" in reasons["Alan Turing"]
    assert "2 people in people.csv are called Ada Lovelace" in reasons["Ada Lovelace"]
    assert 'did you mean "Alan Turing"?' in reasons["Alan Turin"]
    assert reasons["Eve Adams"] == "was typed into Moodle's text box, expected files."


def test_the_lone_student_of_a_zip_keeps_the_name(tmp_path: Path) -> None:
    path = tmp_path / "download.zip"
    path.write_bytes(zipped(under("Ada Lovelace_500000_assignsubmission_file_/", {"work.zip": zipped(BOTH)})))
    assert taken(read_named_batch(path, ASSIGNMENT)) == {"Ada Lovelace": "Ada Lovelace"}


GRADESCOPE = """\
---
submission_90000:
  :submitters:
  - :name: Ada Lovelace
    :sid: s1
    :email: ada@uni.example
  - :name: Alan Turing
    :sid:
    :email: alan@uni.example
  :created_at: !ruby/object:ActiveSupport::TimeWithZone
    utc: &1 2026-11-19 16:03:18.361211000 Z
    zone: &2 !ruby/object:ActiveSupport::TimeZone
      name: Etc/UTC
    time: *1
  :score: 0.0
submission_90001:
  :submitters:
  - :name: Grace Hopper
    :sid: '007'
    :email: grace@uni.example
  :created_at: 2026-11-19 18:03:18.000000000 +02:00
submission_90002:
  :submitters:
  - :name: Eve Adams
    :email: eve@uni.example
"..":
  :submitters:
  - :name: Mallory
"""


def test_gradescopes_export_goes_by_its_list(tmp_path: Path) -> None:
    files = {
        "submission_metadata.yml": GRADESCOPE,
        **under("submission_90000/"),
        **under("submission_90001/"),
        **under("submission_90003/"),
    }
    contents = read_named_batch(laid(tmp_path / "export", files), ASSIGNMENT)
    assert taken(contents) == {"s1": "Ada Lovelace", "alan@uni.example": "Alan Turing", "007": "Grace Hopper"}
    assert [request.source for request in contents.grading_requests] == ["submission_90000"] * 2 + ["submission_90001"]
    when = {str(request.submitted_at) for request in contents.grading_requests}
    assert when == {"2026-11-19 16:03:18+00:00"}
    assert set(refused(contents)) == {"eve@uni.example", "submission_90003", "Mallory"}
    assert "not beside it" in refused(contents)["eve@uni.example"]
    assert "nobody's" in refused(contents)["submission_90003"]


BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 40)
)
MERGES = "m0: &m0 {k: v}\n" + "".join(f"m{n}: &m{n} {{<<: [*m{n - 1}, *m{n - 1}]}}\n" for n in range(1, 40))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("submission_1: [", "not YAML at line"),
        ("- a\n- b\n", "is not a list of submissions"),
        ("[" * 100_000, "cannot be read"),
        ("a: &a [*a]\n", "cannot be read"),
        ("? [a]\n: b\n", "cannot be read"),
        ("a: \x00\n", "cannot be read"),
    ],
)
def test_what_is_no_list_of_gradescopes_is_refused_in_one_sentence(tmp_path: Path, text: str, expected: str) -> None:
    folder = laid(tmp_path / "export", {"submission_metadata.yml": text, **under("submission_1/")})
    with pytest.raises(UsageError, match=expected) as caught:
        read_named_batch(folder, ASSIGNMENT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", [BOMB, MERGES, "submission_1: !!python/object/apply:os.system [exit]\n"])
def test_a_list_that_would_grow_or_act_does_neither(tmp_path: Path, text: str) -> None:
    folder = laid(tmp_path / "export", {"submission_metadata.yml": text, **under("submission_1/")})
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    contents = read_named_batch(folder, ASSIGNMENT)
    assert contents.grading_requests == ()
    assert "submission_1" in {refusal.source for refusal in contents.refusals}
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_a_time_that_is_no_text_is_not_written_out(tmp_path: Path) -> None:
    text = f"{BOMB}submission_1:\n  :submitters:\n  - :name: Ada\n  :created_at: *a39\n"
    folder = laid(tmp_path / "export", {"submission_metadata.yml": text, **under("submission_1/")})
    (request,) = read_named_batch(folder, ASSIGNMENT).grading_requests
    assert request.submitted_at is None


@pytest.mark.parametrize("time", ["0001-01-01 00:00:00 +05:00", "9999-12-31 23:59:59 -05:00"])
def test_a_student_with_an_impossible_time_keeps_nobody_out(tmp_path: Path, time: str) -> None:
    files = {
        **under("submitted/s1/echo-responder/", {**BOTH, "timestamp.txt": time}),
        **under("submitted/s2/echo-responder/"),
    }
    contents = read_named_batch(laid(tmp_path, files) / "submitted", ASSIGNMENT)
    assert [request.submitted_at for request in contents.grading_requests] == [None, None]


def test_nbgraders_folder_goes_by_student_and_assignment(tmp_path: Path) -> None:
    stamp = {"timestamp.txt": "2026-11-19 16:03:18.948203 UTC"}
    files = {
        **under("submitted/s1/echo-responder/", {**BOTH, **stamp}),
        **under("submitted/s2/echo-responder/"),
        **under("submitted/s1/json-queue/", {**BOTH, **stamp}),
        **under("submitted/s3/no-such-thing/"),
    }
    folder = laid(tmp_path, files) / "submitted"
    each = read_named_batch(folder, None)
    pairs = {(request.submission.student, request.assignment.id) for request in each.grading_requests}
    assert pairs == {("s1", "echo-responder"), ("s2", "echo-responder"), ("s1", "json-queue")}
    assert list(refused(each)) == ["s3"]
    first, second = read_named_batch(folder, ASSIGNMENT).grading_requests
    assert (str(first.submitted_at), second.submitted_at) == ("2026-11-19 16:03:18+00:00", None)
    # The time of submission is not part of the submission.
    assert first.submission.sha256 == second.submission.sha256
    with pytest.raises(UsageError, match=r"has submissions for .*, expected for rule-set"):
        read_named_batch(folder, "rule-set")


def test_a_roster_says_who_everybody_is_in_any_order(tmp_path: Path) -> None:
    folder = laid(tmp_path, {**under("a/"), **under("b/")})
    (folder / "roster.csv").write_text("Email;file;NAME;id\nada@uni.example;a;Ada Lovelace;s1\n;b;;s2\n")
    contents = read_named_batch(folder / "roster.csv", ASSIGNMENT)
    students = [(each.student.id, each.student.name, each.student.email) for each in contents.grading_requests]
    assert students == [("s1", "Ada Lovelace", "ada@uni.example"), ("s2", "", "")]


@pytest.mark.parametrize(
    ("text", "expected_people"),
    [
        ("email,id,name\nada@u,s1,Ada\n", {("s1", "Ada", "ada@u")}),
        ("First name\tLast name\tSID\nAda\tLovelace\t7\n", {("7", "Ada Lovelace", "")}),
        ("name,email\nAda,a@u\nAda,b@u\n", {("Ada (a@u)", "Ada", "a@u"), ("Ada (b@u)", "Ada", "b@u")}),
        ("\ufeffIdentifier,Full name\nParticipant 5,Ada\n", {("Ada", "Ada", "")}),
    ],
)  # fmt: skip
def test_tables_of_people_of_many_makes(tmp_path: Path, text: str, expected_people: set[tuple[str, str, str]]) -> None:
    listed = {each for several in people(tmp_path, text).by_name.values() for each in several}
    assert {(each.id, each.name, each.email) for each in listed} == expected_people


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("grade,file\n1,a\n", "no column id, name or email"),
        ("id,name\ns1,Ada\nS1,Bob\n", r"lines 2 and 3: s1 is the id of several"),
        ("id,grade\ns1,2\n,3\n", "line 3 has no id, name or e-mail address"),
        ("id,student\ns1,Ada\n", "two columns id and student"),
    ],
)
def test_what_is_no_table_of_people_is_refused_in_one_sentence(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(UsageError, match=expected) as caught:
        people(tmp_path, text)
    assert "\n" not in str(caught.value)
