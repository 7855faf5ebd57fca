"""CSV rosters: every unusable row is reported with its line, and the others are not affected."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from builders import read_named_batch
from sim.errors import UsageError

PROGRAM = "print('hello')\n"
RESPONDER = "def responder(msg):\n    return msg\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a roster's folder with good submissions a, b and sub/c, a broken zip, and a file outside the folder."""
    own = tmp_path / "class"
    for name in ("class/a", "class/b", "class/sub/c", "outside"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "robot.py").write_text(PROGRAM)
        (tmp_path / name / "responder.py").write_text(RESPONDER)
    with zipfile.ZipFile(own / "d, e.zip", "w") as archive:
        archive.writestr("robot.py", PROGRAM)
        archive.writestr("responder.py", RESPONDER)
    (own / "broken.zip").write_bytes(b"PK\3\4 and no more")
    (own / "way-out").symlink_to(tmp_path)
    return own


def _roster(folder: Path, text: str | bytes) -> Path:
    path = folder / "roster.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_every_bad_row_is_named_by_its_line_and_the_rest_taken(folder: Path) -> None:
    rows = [
        "student,file,assignment",
        "ada,a,echo-responder",
        "bob,missing.zip,echo-responder",
        "ada,b,echo-responder",
        "eve,broken.zip,echo-responder",
        "mia,b,no-such-thing",
        "Zoë 👩‍🚀,b,json-queue",
        "a/b,sub/c,echo-responder",
        "",
        ",b,echo-responder",
        "leo,,echo-responder",
        "kim,b",
        '"tim,b,echo-responder',
        "Lovelace, Ada,a,echo-responder",
        "out,../outside,echo-responder",
        f"abs,{folder / 'a'},echo-responder",
        "link,way-out/outside,echo-responder",
        f"{'x' * 101},a,echo-responder",
        '"O""Neil, Sue",sub\\c,echo-responder',
        "ada,b,json-queue",
    ]
    checked = read_named_batch(_roster(folder, "\n".join(rows)), None)
    taken = [
        (grading_request.submission.student, grading_request.assignment.id)
        for grading_request in checked.grading_requests
    ]
    assert taken == [
        ("ada", "echo-responder"),
        ("Zoë 👩‍🚀", "json-queue"),
        ("a/b", "echo-responder"),
        ('O"Neil, Sue', "echo-responder"),
        ("ada", "json-queue"),
    ]
    expected = {
        3: "does not exist",
        4: "already this student's submission",
        5: "broken.zip",
        6: "no-such-thing",
        10: "has no student",
        11: "has no file",
        12: "has no assignment",
        13: "quotation marks",
        14: "cells for 3 columns",
        15: "outside the roster's folder",
        16: "outside the roster's folder",
        17: "outside the roster's folder",
        18: "101 characters",
    }
    assert len(checked.refusals) == len(expected)
    for refusal, (line, part) in zip(checked.refusals, expected.items(), strict=True):
        assert refusal.source.split(":")[0] == f"line {line}"
        assert part in refusal.reason
        assert "\n" not in refusal.reason


@pytest.mark.parametrize(
    "text",
    [
        "student,file\nada,a\n",
        b"\xef\xbb\xbfstudent;file\r\nada;a\r\n",
        'File,Mark,"STUDENT"\r"a",,"ada",\r',
        "student\tfile\nada\ta",
        'student;file\n"ada"\n  ;a\nada;a\n',
    ],
)
def test_rosters_of_many_makes_say_the_same(folder: Path, text: str | bytes) -> None:
    checked = read_named_batch(_roster(folder, text), "echo-responder")
    assert [(row.submission.student, row.source) for row in checked.grading_requests] == [("ada", "a")]


def test_a_row_with_an_assignment_of_its_own_keeps_it(folder: Path) -> None:
    checked = read_named_batch(_roster(folder, "student,file,assignment\nada,a,json-queue\nbob,b,\n"), "echo-responder")
    assert [row.assignment.id for row in checked.grading_requests] == ["json-queue", "echo-responder"]


@pytest.mark.parametrize("time", ["0001-01-01T00:00+05:00", "9999-12-31T23:59-05:00", "soon"])
def test_an_impossible_time_costs_one_row(folder: Path, time: str) -> None:
    rows = f"student,file,submitted_at\nada,a,{time}\nbob,b,2026-11-30 17:00\n"
    contents = read_named_batch(_roster(folder, rows), "echo-responder")
    assert [request.submission.student for request in contents.grading_requests] == ["bob"]
    assert [refusal.source for refusal in contents.refusals] == ["line 2: ada"]
    assert "expected a moment like" in contents.refusals[0].reason


def test_an_open_quotation_mark_costs_one_row(folder: Path) -> None:
    text = 'student,file\nada,a\n"bob,b\neve,b\nmia,"d, e.zip"\n'
    checked = read_named_batch(_roster(folder, text), "echo-responder")
    assert [row.submission.student for row in checked.grading_requests] == ["ada", "eve", "mia"]
    assert [each.source for each in checked.refusals] == ["line 3"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty"),
        ("student,file\n\n", "has no rows"),
        ("name,file\nada,a\n", "no column student"),
        ("student,student,file\nada,ada,a\n", "two columns student"),
        ("student,file\nZoë,a\n".encode("utf-16"), "not UTF-8"),
        ("student,file\nada,a\nZoë,b\n".encode("cp1252"), "line 3 is not UTF-8"),
        ('"student,file\nada,a\n', "line 1 has quotation marks"),
        ("student,file\n" + "a,a\n" * 200_000, "more than 200000 lines"),
    ],
)
def test_what_is_no_roster_is_refused_in_one_sentence(folder: Path, text: str | bytes, expected: str) -> None:
    with pytest.raises(UsageError, match=expected) as caught:
        read_named_batch(_roster(folder, text), "echo-responder")
    assert "\n" not in str(caught.value)
