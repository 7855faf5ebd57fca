"""Students' names: a name that can be mistaken for another is refused and reported, in all input and output."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from sqlalchemy import insert, select, update

from builders import grading_request, read_named_batch
from command import robomark
from service.reports.output_files import build_file_stem, build_file_stems, build_refused_stems
from service.store.batches import intake
from service.store.engine import Store, now
from service.store.people.students import Students, ensure_course
from service.store.states import Role
from service.store.tables.people import Enrolment, Person
from service.store.tables.submissions import Job, SubmissionRow
from sim.errors import UsageError
from submissions.batch_folder import BatchContents
from submissions.bundle import read_submission
from submissions.student_identity import Student
from submissions.student_names import compute_name_forms, find_look_alikes, normalise_name

ASSIGNMENT = "echo-responder"
RESPONDER = "def responder(msg):\n    return msg\n"

#: Ada's name, and imitations of it by another student.
ATTACKS = {
    "a leading space": ("ada", " ada"),
    "a trailing space": ("ada", "ada "),
    "two spaces": ("Ada King", "Ada  King"),
    "a space that does not break": ("Ada King", "Ada\u00a0King"),
    "an ideographic space": ("Ada King", "Ada\u3000King"),
    "a joiner": ("ada", "a\u200dda"),
    "a space without width": ("ada", "a\u200bda"),
    "a soft hyphen": ("ada", "a\u00adda"),
    "a mark for right to left": ("ada", "ada\u200f"),
    "an override of direction": ("ada", "\u202dada"),
    "a combining grapheme joiner": ("ada", "a\u034fda"),
    "a blank letter of Hangul": ("ada", "ada\u3164"),
    "a blank of Braille": ("Ada King", "Ada\u2800King"),
    "half a blank of Hangul": ("Ada King", "Ada\uffa0King"),
    "another variation of an emoji": ("Zoe \u2764", "Zoe \u2764\ufe0f"),
    "another case": ("ada", "Ada"),
    "case beyond Latin": ("\u03a3\u03bf\u03c6\u03af\u03b1", "\u03c3\u03bf\u03c6\u03af\u03b1"),
    "sharp s": ("Strau\u00df", "Strauss"),
    "an accent of its own": ("Zo\u00eb", "Zoe\u0308"),
    "full width": ("ada", "\uff41\uff44\uff41"),
    "a ligature": ("Sofia", "So\ufb01a"),
    "letters of mathematics": ("ada", "\U0001d41a\U0001d41d\U0001d41a"),
    "Cyrillic": ("ada", "\u0430da"),
    "Cyrillic, all of it": ("cope", "\u0441\u043e\u0440\u0435"),
    "a Greek capital": ("Nina", "\u039dina"),
    "Cyrillic and case": ("bob", "\u0412OB"),
    "Greek Iota for I": ("Ida", "\u0399da"),
    "Cherokee": ("Ada", "\u13aada"),
    "a dotless i": ("Mia", "M\u0131a"),
    "a dot too many": ("Mia", "Mi\u0307a"),
    "a trailing dot": ("ada", "ada."),
}
PAIRS = pytest.mark.parametrize(("ada", "eve"), ATTACKS.values(), ids=ATTACKS)


def _submit(folder: Path, name: str, whose: str, toml: str = "") -> Path:
    own = folder / name
    own.mkdir(parents=True)
    (own / "robot.py").write_text(f"print({whose!r})\n")
    (own / "responder.py").write_text(RESPONDER)
    if toml:
        (own / "submission.toml").write_text(toml)
    return own


def _folder(tmp_path: Path, *names: str) -> Path:
    for name in names:
        _submit(tmp_path / "class", name, f"by {name!a}")
    return tmp_path / "class"


def _zip(tmp_path: Path, *names: str) -> Path:
    folder = _folder(tmp_path, *names)
    with zipfile.ZipFile(tmp_path / "class.zip", "w") as archive:
        for path in sorted(folder.rglob("*.py")):
            archive.write(path, str(path.relative_to(folder)))
    return tmp_path / "class.zip"


def _roster(tmp_path: Path, *names: str) -> Path:
    with (tmp_path / "roster.csv").open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["student", "file"])
        for number, name in enumerate(names):
            _submit(tmp_path, str(number), f"by {name!a}")
            rows.writerow([name, str(number)])
    return tmp_path / "roster.csv"


def _refused(checked: BatchContents) -> list[str]:
    sentences = [refusal.reason for refusal in checked.refusals]
    assert all("\n" not in sentence and sentence.endswith(".") for sentence in sentences)
    return sentences


@pytest.mark.parametrize("batch", [_folder, _zip, _roster])
@PAIRS
def test_in_a_batch_neither_of_two_who_are_alike_is_taken_in(
    tmp_path: Path, batch: Callable[..., Path], ada: str, eve: str
) -> None:
    checked = read_named_batch(batch(tmp_path, ada, "bob the third", eve), ASSIGNMENT)
    assert [each.submission.student for each in checked.grading_requests] == ["bob the third"]
    assert len(_refused(checked)) == 2
    assert all("cannot be distinguished from" in each or "too, and not the same" in each for each in _refused(checked))


@pytest.mark.long
@PAIRS
def test_nobody_takes_the_place_of_who_is_in_the_course(tmp_path: Path, store: Store, ada: str, eve: str) -> None:
    """Refused in a later batch, except spellings that normalise to the same name."""
    batches = [
        read_named_batch(_folder(tmp_path / str(number), name), ASSIGNMENT) for number, name in enumerate((ada, eve))
    ]
    first, later = (
        intake.accept_new_submissions(store, "b", each.grading_requests, each.refusals, max_attempts=3)
        for each in batches
    )
    assert first.batch is not None
    assert first.refused == ()
    if normalise_name(ada) == normalise_name(eve) and eve == "Zoe\u0308":
        assert later.batch is not None  # the same letters, written on any machine
        return
    assert later.batch is None
    (refusal,) = later.refused
    assert "cannot be distinguished from" in refusal.reason
    with pytest.raises(UsageError, match="cannot be distinguished from"):
        intake.accept_batch(store, "b", batches[1].grading_requests, (), max_attempts=3)


@PAIRS
def test_files_of_alike_names_never_share_a_name(ada: str, eve: str) -> None:
    if normalise_name(ada) != normalise_name(eve):
        assert build_file_stem(normalise_name(ada)) != build_file_stem(normalise_name(eve))


@pytest.mark.parametrize(
    "names",
    [
        ("Kai", "Kal"),
        ("a1", "al", "a10", "alo"),
        ("Zoe", "Zo\u00eb"),
        ("Jean-Luc", "Jean Luc", "JeanLuc"),
        ("\u0412\u0435\u0440\u0430", "Vera"),
        ("\u5f20\u4f1f", "\u738b\u4f1f"),
        ("\U0001f469\u200d\U0001f680", "\U0001f469\U0001f680 2"),
        ("student 1", "student 11"),
    ],
)
def test_students_of_different_names_are_all_taken_in(tmp_path: Path, names: tuple[str, ...]) -> None:
    assert find_look_alikes(names) == {}
    checked = read_named_batch(_folder(tmp_path, *names), ASSIGNMENT)
    assert {each.submission.student for each in checked.grading_requests} == set(names)
    assert checked.refusals == ()


def test_of_one_students_several_in_a_batch_none_is_chosen_where_they_differ(tmp_path: Path) -> None:
    folder = _folder(tmp_path, "ada", "bob")
    with zipfile.ZipFile(folder / "ada.zip", "w") as archive:
        archive.writestr("robot.py", "print('not hers')\n")
        archive.writestr("responder.py", RESPONDER)
    checked = read_named_batch(folder, ASSIGNMENT)
    assert [each.submission.student for each in checked.grading_requests] == ["bob"]
    assert [each.source for each in checked.refusals] == ["ada", "ada.zip"]
    assert all("not the same; expected one" in sentence for sentence in _refused(checked))


@pytest.mark.parametrize("name", ["\u200b", "\u3164", "x" * 101])
def test_a_folder_that_names_nobody_is_refused(tmp_path: Path, name: str) -> None:
    checked = read_named_batch(_folder(tmp_path, "ada", name), ASSIGNMENT)
    assert [each.submission.student for each in checked.grading_requests] == ["ada"]
    (sentence,) = _refused(checked)
    assert f"a student's name of {len(normalise_name(name))} characters" in sentence


@pytest.mark.parametrize("named", ["ada", "Ada ", "../ada", "\u0430da"])
def test_a_submission_does_not_say_whose_it_is(tmp_path: Path, named: str) -> None:
    own = _submit(tmp_path, "eve", "eve's", f'student = "{named}"\n')
    submission = read_submission(own)
    assert submission.student == "eve"
    assert "submission.toml names the student" in submission.notes[0]
    roster = tmp_path / "roster.csv"
    roster.write_text("student,file\nmallory,eve\n")
    (taken,) = read_named_batch(roster, ASSIGNMENT).grading_requests
    assert taken.submission.student == "mallory"


def test_grade_keeps_reports_apart(tmp_path: Path) -> None:
    ada, eve = _submit(tmp_path, "ada", "ada's"), _submit(tmp_path, "eve", "eve's", 'student = "ada"\n')
    blank, elsewhere = _submit(tmp_path, " ada", "eve's"), _submit(tmp_path / "b", "bob", "bob's")
    other = _submit(tmp_path / "c", "bob", "eve's")
    reports = tmp_path / "reports"
    arguments = ["grade", *map(str, (ada, eve, blank, elsewhere, other)), "-a", ASSIGNMENT, "--report", str(reports)]
    ended = robomark(*arguments)
    assert ended.returncode == 2
    assert {path.name for path in reports.iterdir()} == {"eve.html"}
    sentences = ended.stderr.splitlines()
    for path in (ada, blank):
        assert any(f"{path}: its student cannot be distinguished from" in sentence for sentence in sentences)
    for path in (elsewhere, other):
        assert any(f"{path}: bob is named more than once" in sentence for sentence in sentences)


def test_a_report_made_later_does_not_take_the_place_of_anothers(tmp_path: Path) -> None:
    ada, blank = _submit(tmp_path, "ada", "ada's"), _submit(tmp_path, " ada", "eve's")
    reports = tmp_path / "reports"
    for path in (ada, blank):
        assert robomark("grade", path, "-a", ASSIGNMENT, "--report", reports).returncode == 0
    assert len(list(reports.iterdir())) == 2
    assert "ada&#39;s" in (reports / "ada.html").read_text()


def test_an_extension_is_for_one_who_can_be_told_from_others(store: Store) -> None:
    intake.accept_submission(store, grading_request("ada"), max_attempts=3)
    with store.transaction() as session:
        students = Students(session, ensure_course(session, "default", now(session)))
        known = students.enrol(Student("ada"), now(session))
        assert known == session.scalar(select(Enrolment.id))
        for name in (" ada", "Ada", "\u0430da", "\u200b"):
            with pytest.raises(UsageError):
                students.enrol(Student(name), now(session))
        assert students.enrol(Student("bob"), now(session)) != known
        assert session.scalars(select(Enrolment.student)).all() == ["ada", "bob"]


def test_who_was_first_written_with_a_blank_may_go_on_so_until_the_name_itself_comes(store: Store) -> None:
    with store.transaction() as session:
        at = now(session)
        students = Students(session, ensure_course(session, "default", at))
        known = students.enrol(Student("ada "), at)
        assert students.enrol(Student("ada "), at) == known
        assert students.enrol(Student("ada"), at) == known
        with pytest.raises(UsageError, match="cannot be distinguished from"):
            students.enrol(Student("ada "), at)


def test_name_and_address_are_those_that_were_told_last(store: Store) -> None:
    with store.transaction() as session:
        at = now(session)
        students = Students(session, ensure_course(session, "default", at))
        known = students.enrol(Student("s1"), at)
        for each in (Student("s1", "Ada King", "ada@uni.example"), Student("s1", "Ada Lovelace"), Student("s1")):
            assert students.enrol(each, at) == known
        row = session.scalars(select(Enrolment)).one()
        assert (row.name, row.email) == ("Ada Lovelace", "ada@uni.example")


def test_only_who_is_there_is_found(store: Store) -> None:
    with store.transaction() as session:
        at = now(session)
        students = Students(session, ensure_course(session, "default", at))
        known = students.enrol(Student("Ada Lovelace"), at)
        assert students.load_enrolment(" Ada  Lovelace") == known
        with pytest.raises(UsageError, match='did you mean "Ada Lovelace"'):
            students.load_enrolment("Ada Lovelance")
        with pytest.raises(UsageError, match="there is no student 'bob' in this course; to enrol a student"):
            students.load_enrolment("bob")


def test_students_of_an_older_database_go_on_under_their_names(store: Store) -> None:
    """Two students that today's rules would not distinguish, and one enrolled with blanks by an extension."""
    with store.transaction() as session:
        at = now(session)
        course_id = ensure_course(session, "default", at)
        for number, name in enumerate(("Ada", "ada", " bob")):
            session.execute(insert(Person).values(id=number + 1, created_at=at))
            row = {"id": number + 1, "course_id": course_id, "person_id": number + 1, "student": name, "written": name}
            session.execute(insert(Enrolment).values(role=Role.STUDENT, **row))
    for name, expected in (("Ada", 1), ("ada", 2), ("bob", 3)):
        accepted = intake.accept_submission(store, grading_request(name), max_attempts=3)
        assert (accepted.student, accepted.attempt) == (name, 1)
        with store.reading() as session:
            assert session.scalar(select(Job.enrolment_id).where(Job.id == accepted.job_id)) == expected
    with pytest.raises(UsageError, match="cannot be distinguished from"):
        intake.accept_submission(store, grading_request("ADA"), max_attempts=3)


def test_an_older_hash_means_only_that_it_is_graded_again(store: Store) -> None:
    taken = grading_request("ada")
    intake.accept_new_submissions(store, "b", [taken], (), max_attempts=3)
    with store.transaction() as session:
        session.execute(update(SubmissionRow).values(sha256="0" * 64))
    again = intake.accept_new_submissions(store, "b", [taken], (), max_attempts=3)
    assert again.batch is not None
    assert [(job.attempt, job.staff_only) for job in again.batch.jobs] == [(2, "")]
    assert intake.accept_new_submissions(store, "b", [taken], (), max_attempts=3).known != ()


@given(st.text(max_size=30))
@example("a\u0300 \u200d\u0301")
@example("\u2000\u200d \u3164.")
def test_there_is_one_normal_form(text: str) -> None:
    name = normalise_name(text)
    assert normalise_name(name) == name
    assert name == "" or compute_name_forms(name) == compute_name_forms(text)
    assert "\n" not in name
    assert name == name.strip()


NAMES = st.text(st.sampled_from("aA \u00e9-._~+/\\\u2764\u0431"), max_size=6) | st.text(max_size=120)


@given(st.lists(NAMES, min_size=2, max_size=6, unique=True))
@example(["Ada Lovelace", "Ada-Lovelace", "Ada--Lovelace", "Ada_Lovelace", "Ada.Lovelace", "Ada/Lovelace"])
@example(["../ada", "ada", "-ada", "ada.", "ada~1", "ada+json-queue"])
@example(["index", "Index", "", "report"])
@example(["x" * 200, "x" * 201, "\U0001d54f" * 60])
def test_files_of_different_names_have_different_names(names: list[str]) -> None:
    stems = build_file_stems([(name, "json-queue") for name in names])
    assert len(set(stems)) == len(names)
    assert stems == [build_file_stem(name) for name in names]
    for stem in stems:
        assert len(stem.encode()) < 200
        assert not set(stem) & set("/\\\0\n ")
        assert not stem.startswith((".", "-"))
        assert stem.casefold() != "index"


def test_a_student_with_several_assignments_has_a_file_for_each() -> None:
    graded = [("ada", "json-queue"), ("bob", "json-queue"), ("ada", "echo-responder")]
    assert build_file_stems(graded) == ["ada+json-queue", "bob", "ada+echo-responder"]
    assert build_file_stems(graded[::-1]) == build_file_stems(graded)[::-1]


def test_who_was_refused_together_has_a_file_each() -> None:
    refused = [("submission_1", "ada"), ("submission_1", "bob"), ("submission_2", "ada"), ("line 4: ada", "ada")]
    assert len(set(build_refused_stems(refused))) == 4
    assert build_refused_stems(refused)[2] == "submission_2+refused"


def test_files_in_an_index_of_a_batch_keep_their_students_names() -> None:
    assert [build_file_stem(name) for name in ("Ada Lovelace", "Jean-Luc Picard", "Zo\u00eb", "1234_ada_")] == [
        "Ada-Lovelace", "Jean--Luc-Picard", "Zo\u00eb", "1234_ada_",
    ]  # fmt: skip
