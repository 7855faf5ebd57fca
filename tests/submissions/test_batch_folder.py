"""Folders and zips of submissions: every bad row is reported, and the others are not affected."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import pytest

from builders import read_named_batch
from service.commands.grading import read_with_assignment
from sim.errors import UsageError
from submissions.assignment.folder import locate_assignment_folder

PROGRAM = "print('hello')\n"
RESPONDER = "def responder(msg):\n    return msg\n"


def _student(folder: Path, name: str, *, responder: bool = True, toml: str = "") -> None:
    own = folder / name
    own.mkdir(parents=True)
    (own / "robot.py").write_text(PROGRAM)
    if responder:
        (own / "responder.py").write_text(RESPONDER)
    if toml:
        (own / "submission.toml").write_text(toml)


@pytest.fixture
def class_folder(tmp_path: Path) -> Path:
    """Return a class with two good submissions and one of every fault."""
    folder = tmp_path / "class"
    _student(folder, "ada")
    _student(folder, "Zoë 🤖")
    _student(folder, "no-responder", responder=False)
    (folder / "empty").mkdir()
    (folder / "notes.docx").write_bytes(b"PK")
    (folder / "broken.zip").write_bytes(b"PK\3\4 and no more")
    (folder / ".hidden").write_text("x")
    (folder / "link").symlink_to("/etc")
    with zipfile.ZipFile(folder / "ada.zip", "w") as archive:
        archive.writestr("robot.py", PROGRAM)
        archive.writestr("responder.py", RESPONDER)
    with zipfile.ZipFile(folder / "climber.zip", "w") as archive:
        archive.writestr("../robot.py", PROGRAM)
    return folder


def test_every_bad_row_is_named_and_the_rest_taken(class_folder: Path) -> None:
    checked = read_named_batch(class_folder, "echo-responder")
    taken = [grading_request.submission.student for grading_request in checked.grading_requests]
    assert taken == ["Zoë 🤖", "ada", "no-responder"]
    assert "There is no responder.py" in checked.grading_requests[-1].submission.notes[0]
    problems = {each.source: each.reason for each in checked.refusals}
    assert set(problems) == {
        "empty", "notes.docx", "broken.zip", "link", "ada.zip", "climber.zip",
    }  # fmt: skip
    assert "already this student's submission" in problems["ada.zip"]
    assert all(sentence.strip().endswith(".") and "\n" not in sentence for sentence in problems.values())


@pytest.mark.parametrize("top", ["", "class/", "__MACOSX/x\nclass/"])
def test_a_zip_of_the_same_folder_is_the_same(class_folder: Path, tmp_path: Path, top: str) -> None:
    *ignored, prefix = top.split("\n")
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        for name in ignored:
            archive.writestr(name, "x")
        for path in sorted(class_folder.rglob("*")):
            if path.is_file() and not path.is_symlink():
                archive.write(path, prefix + str(path.relative_to(class_folder)))
    checked = read_named_batch(tmp_path / "all.zip", "echo-responder")
    taken = [grading_request.submission.student for grading_request in checked.grading_requests]
    assert taken == ["Zoë 🤖", "ada", "no-responder"]
    assert "There is no responder.py" in checked.grading_requests[-1].submission.notes[0]
    assert {each.source for each in checked.refusals} == {
        "notes.docx", "broken.zip", "ada.zip", "climber.zip",
    }  # fmt: skip


def test_each_submission_may_name_its_own_assignment(tmp_path: Path) -> None:
    folder = tmp_path / "mixed"
    _student(folder, "ada", toml='assignment = "echo-responder"\n')
    _student(folder, "bob", toml='assignment = "json-queue"\n')
    _student(folder, "eve", toml='assignment = "no-such-thing"\n')
    checked = read_named_batch(folder, None)
    named = {
        grading_request.submission.student: grading_request.assignment.id
        for grading_request in checked.grading_requests
    }
    assert named == {"ada": "echo-responder", "bob": "json-queue"}
    (refusal,) = checked.refusals
    assert refusal.source == "eve"
    assert "no-such-thing" in refusal.reason


def test_a_submission_that_we_fail_on_is_the_only_one_that_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "class"
    for name in ("ada", "bob"):
        _student(folder, name)
    _student(folder, "eve", toml=f"run = 0x{'f' * 20_000}\n")
    checked = read_named_batch(folder, "echo-responder")
    assert [each.submission.student for each in checked.grading_requests] == ["ada", "bob"]
    assert "number that is too long" in checked.refusals[0].reason

    def fails(*_arguments: object, **_named: object) -> None:
        raise ValueError("nobody thought of this")

    (folder / "bob" / "submission.toml").write_text("x = 1\n")
    monkeypatch.setattr("submissions.bundle.read_meta", lambda data, where: fails() if data else {})
    checked = read_named_batch(folder, "echo-responder")
    assert [each.submission.student for each in checked.grading_requests] == ["ada"]
    assert {each.source: "fault in Robomark" in each.reason for each in checked.refusals} == {"bob": True, "eve": True}


def test_a_submission_brings_no_assignment_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "class"
    _student(folder, "eve", toml='assignment = "eve"\n')
    shutil.copytree(locate_assignment_folder("echo-responder"), folder / "bait")
    (folder / "eve" / "assignment.toml").write_bytes((folder / "bait" / "assignment.toml").read_bytes())
    monkeypatch.chdir(folder)
    with pytest.raises(UsageError, match="no assignment 'eve' in the catalogue"):
        read_with_assignment(Path("eve"), None)
    checked = read_named_batch(Path(), None)
    assert checked.grading_requests == ()
    assert "no assignment 'eve' in the catalogue" in {each.source: each.reason for each in checked.refusals}["eve"]


def test_in_a_batch_nobody_submits_for_somebody_else(tmp_path: Path) -> None:
    folder = tmp_path / "class"
    _student(folder, "ada", toml='student = "bob"\n')
    _student(folder, "bob")
    checked = read_named_batch(folder, "echo-responder")
    assert checked.refusals == ()
    ada, bob = checked.grading_requests
    assert (ada.submission.student, bob.submission.student) == ("ada", "bob")
    assert "submission.toml names the student bob" in " ".join(ada.submission.notes)


def test_a_folder_named_after_an_assignment_names_it(tmp_path: Path) -> None:
    folder = tmp_path / "echo-responder"
    _student(folder, "ada")
    (grading_request,) = read_named_batch(folder, None).grading_requests
    assert grading_request.assignment.id == "echo-responder"


def _one_request(tmp_path: Path) -> Path:
    _student(tmp_path, "ada")
    return tmp_path / "ada"


def _nothing(tmp_path: Path) -> Path:
    return tmp_path / "nowhere"


def _empty(tmp_path: Path) -> Path:
    (tmp_path / "empty").mkdir()
    return tmp_path / "empty"


def _text_file(tmp_path: Path) -> Path:
    (tmp_path / "list.txt").write_text("ada")
    return tmp_path / "list.txt"


def _broken_zip(tmp_path: Path) -> Path:
    (tmp_path / "all.zip").write_bytes(b"PK\3\4")
    return tmp_path / "all.zip"


def _climbing_zip(tmp_path: Path) -> Path:
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("ada/../../robot.py", PROGRAM)
    return tmp_path / "all.zip"


def _double_zip(tmp_path: Path) -> Path:
    with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
        archive.writestr("ada/robot.py", PROGRAM)
        with pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("ada/robot.py", PROGRAM)
    return tmp_path / "all.zip"


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (_one_request, "looks like one submission"),
        (_nothing, "does not exist"),
        (_empty, "is empty"),
        (_text_file, "neither a folder nor a .zip"),
        (_broken_zip, "cannot be unpacked"),
        (_climbing_zip, "outside it"),
        (_double_zip, "two files of the same name"),
    ],
)
def test_what_is_no_batch_is_refused_in_one_sentence(tmp_path: Path, make: object, expected: str) -> None:
    path = make(tmp_path)  # type: ignore[operator]
    with pytest.raises(UsageError, match=expected) as caught:
        read_named_batch(path, "echo-responder")
    assert "\n" not in str(caught.value)


def test_a_zip_that_grows_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("submissions.batch_folder._MAX_BYTES", 1_000_000)
    with zipfile.ZipFile(tmp_path / "all.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("ada/robot.py", b"\0" * 2_000_000)
    with pytest.raises(UsageError, match="unpacks to more than"):
        read_named_batch(tmp_path / "all.zip", "echo-responder")


def test_an_unknown_assignment_is_the_callers_mistake(class_folder: Path) -> None:
    with pytest.raises(UsageError, match="no-such-thing"):
        read_named_batch(class_folder, "no-such-thing")
