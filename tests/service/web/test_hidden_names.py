"""With names hidden, neither the order nor a value in an instructor's answer identifies a student."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

import acting
import report_builders
from builders import echo, grading_request, prepared
from naming import is_named
from service.operations import privacy, sign_in_links
from service.operations.context import create_machine_actor
from service.store.batches import intake, regrade_changes
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.hidden_names import HiddenNames, load_hidden_names
from service.store.people.membership import Member
from service.store.queue import jobs
from web import COURSE, Web, submit, web_in, words
from zips import zipped

STUDENTS = ("ada", "bea", "cyd", "dot", "eve", "fay", "gil", "hal")
HERE = "/api/v1/courses/1"
HIDDEN = "hidden for echo-responder, and this could show who submitted to it; show the names first"


@pytest.fixture
def web(tmp_path: Path) -> Iterator[Web]:
    with web_in(tmp_path) as made:
        yield made


@pytest.fixture
def grace(web: Web) -> Member:
    return web.instructor("grace")


@pytest.fixture(scope="module")
def regraded(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, str]:
    """Return a database with a regrade of eight submissions, one per student, with names hidden."""
    with web_in(tmp_path_factory.mktemp("home")) as web:
        web.instructor("grace")
        requests = [grading_request(who) for who in STUDENTS]
        batch = intake.accept_batch(web.store, "week one", requests, (), course=COURSE, max_attempts=3)
        _grade_all(web)
        with web.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.hide_names(session, 1, "echo-responder", True)
        made = acting.regrade(web.store, batch.id, None, max_attempts=3, actor="grace")
        _grade_all(web)
    return (web.settings.home / "robomark.db").read_bytes(), made.batch_id


@pytest.fixture
def regrade(web: Web, grace: Member, regraded: tuple[bytes, str]) -> str:
    """Use a copy of the database with the regrade. Grace is its first member, too."""
    database, batch_id = regraded
    web.store.engine.dispose()
    (web.settings.home / "robomark.db").write_bytes(database)
    return batch_id


def _grade_all(web: Web) -> None:
    while claim := jobs.claim_job(web.store, "worker", 60):
        jobs.finish_job(web.store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))


def test_changes_of_a_regrade_are_in_the_order_of_the_shown_names(web: Web, grace: Member, regrade: str) -> None:
    token = web.token(grace, "read")
    changes = web.browser().get(f"{HERE}/batches/{regrade}/changes", headers=token).json()["items"]
    hidden_names = load_hidden_names(web.store, 1)
    assert [each["student"] for each in changes] == sorted(
        hidden_names.label_student("echo-responder", who) for who in STUDENTS
    )


def test_the_page_of_changes_is_in_the_order_of_random_ids(web: Web, grace: Member, regrade: str) -> None:
    with web.store.reading() as session:
        hidden_names = regrade_changes.load_changes_page(session, regrade, 1, load_hidden_names(web.store, 1))
    assert [each.job_id for each in hidden_names.changes] == sorted(each.job_id for each in hidden_names.changes)
    text = web.browser(grace).get(f"/courses/1/batches/{regrade}/changes").text
    assert [who for who in STUDENTS if re.search(rf"\b{who}\b", text, re.IGNORECASE)] == []


def test_a_students_data_has_nothing_that_a_nameless_row_has_too(web: Web, grace: Member, regrade: str) -> None:
    token = web.token(grace, "manage", "read")
    people = web.browser().get(f"{HERE}/people", headers=token).json()["items"]
    enrolment = next(each["enrolment"] for each in people if each["id"] == "ada")
    packed = web.browser().get(f"{HERE}/people/{enrolment}/data", headers=token).content
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert archive.namelist() == ["student.json"]
        student = json.loads(archive.read("student.json"))
    assert student["submissions"] == []
    rows = web.browser().get(f"{HERE}/batches/{regrade}/grades", headers=token).json()["items"]
    times = {each[name] for each in rows for name in ("queued_at", "finished_at")}
    assert times
    assert not {"since", "signed_in_with"} & set(student)
    assert not {value[:10] for value in times if value[:10] in json.dumps(student)}


def test_students_still_have_all_of_their_own_data(web: Web, regrade: str) -> None:
    token = web.token(web.student("ada"), "read")
    packed = web.browser().get(f"{HERE}/mine/data", headers=token).content
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        assert len(json.loads(archive.read("student.json"))["submissions"]) == 1


def test_an_upload_that_is_not_new_names_nobody_beside_a_grade(web: Web, grace: Member, regrade: str) -> None:
    again = zipped({f"{who}/{name}": text for who in STUDENTS for name, text in _files(who).items()})
    token = web.token(grace, "submit")
    path = f"{HERE}/batches?assignment=echo-responder&name=again"
    headers = {**token, "content-type": "application/zip"}
    known = web.browser().post(path, headers=headers, content=again).json()["known"]
    hidden_names = load_hidden_names(web.store, 1)
    assert [each["student"] for each in known] == sorted(
        hidden_names.label_student("echo-responder", who) for who in STUDENTS
    )
    browser = web.browser(grace)
    files = {"files": ("again.zip", again, "application/zip")}
    upload = submit(browser, "/courses/1/batches/uploads", {"assignment": "echo-responder"}, files=files)
    answer = submit(browser, f"{upload.headers['location']}/confirm")
    assert set(re.findall(r"Participant \w{6}", answer.text)) == {each["student"] for each in known}
    assert [who for who in STUDENTS if is_named(who, words(answer.text))] == []


def test_a_preview_does_not_tell_who_submitted_the_files_of_a_row(web: Web, grace: Member, regrade: str) -> None:
    """An instructor who sends the files of one row under every name learns nothing."""
    everybody = [*STUDENTS, web.student("newcomer").id]
    sent = zipped({f"{who}/{name}": text for who in everybody for name, text in _files(STUDENTS[0]).items()})
    headers = {**web.token(grace, "submit"), "content-type": "application/zip"}
    path = f"{HERE}/batches/preflight?assignment=echo-responder"
    ahead = web.browser().post(path, headers=headers, content=sent).json()["submissions"]
    assert sorted(each["student"] for each in ahead) == sorted(everybody)
    assert len({(each["known"], each["copied"], each["enrolled"]) for each in ahead}) == 1


def _files(who: str) -> dict[str, str]:
    submission = grading_request(who).submission
    assert submission.program is not None
    assert submission.responder is not None
    return {"robot.py": submission.program.text, "responder.py": submission.responder.text}


@pytest.mark.parametrize("form", ["moodle-worksheet", "moodle-feedback"])
def test_a_file_that_is_matched_by_names_is_refused(web: Web, grace: Member, regrade: str, form: str) -> None:
    token = web.token(grace, "read")
    path = f"{HERE}/batches/{regrade}"
    if form == "moodle-worksheet":
        headers = {**token, "content-type": "text/csv"}
        answer = web.browser().post(f"{path}/worksheet", headers=headers, content=b"Identifier,Grade\n")
    else:
        answer = web.browser().get(f"{path}/export?format={form}", headers=token)
    assert answer.status_code == 422
    assert "but names are hidden for echo-responder; show the names first" in answer.json()["detail"]


@pytest.mark.parametrize("who", ["ada", "newcomer"])
def test_an_instructor_creates_no_link_that_opens_a_hidden_submission(
    web: Web, grace: Member, regrade: str, who: str
) -> None:
    student, token = web.student(who), web.token(grace, "manage")
    browser = web.browser(grace)
    for way in ("links", f"{student.enrolment_id}/link"):
        refused = web.browser().post(f"{HERE}/people/{way}", headers=token)
        assert (refused.status_code, HIDDEN in refused.json()["detail"]) == (422, True)
        refused = submit(browser, f"/courses/1/people/{way}")
        assert (refused.status_code, HIDDEN in words(refused.text)) == (422, True)
    service = web.app.state.context.service
    assert sign_in_links.make_students_link(service, create_machine_actor(), 1, student.enrolment_id)
    with web.store.transaction() as session:
        open_assignments.hide_names(session, 1, "echo-responder", False)
    assert web.browser().post(f"{HERE}/people/{student.enrolment_id}/link", headers=token).status_code == 201


@pytest.mark.parametrize("who", ["ada", "newcomer"])
def test_a_removal_does_not_tell_who_submitted_with_a_hidden_name(
    web: Web, grace: Member, regrade: str, who: str
) -> None:
    student = web.student(who)
    refused = submit(web.browser(grace), f"/courses/1/people/{student.enrolment_id}/remove")
    assert (refused.status_code, HIDDEN in words(refused.text)) == (422, True)
    refused = web.browser().delete(f"{HERE}/people/{student.enrolment_id}", headers=web.token(grace, "manage"))
    assert (refused.status_code, HIDDEN in refused.json()["detail"]) == (422, True)
    erased = privacy.erase_student(web.app.state.context.service, create_machine_actor(), 1, student.enrolment_id)
    assert erased.students == 1


def test_links_are_created_before_the_first_submission_with_a_hidden_name(web: Web, grace: Member) -> None:
    token, ada = web.token(grace, "manage"), web.student("ada")
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", True)
    for way in ("links", f"{ada.enrolment_id}/link"):
        assert web.browser().post(f"{HERE}/people/{way}", headers=token).status_code == 201


def test_submission_numbers_identify_neither_students_nor_their_other_submissions(web: Web) -> None:
    students = [f"student-{number:02}" for number in range(30)]
    first = [grading_request(each, f"print({each!r})\n") for each in students]
    again = [grading_request(each, f"print({each!r}, 2)\n") for each in students]
    other = [replace(each, assignment=replace(echo(), id="other")) for each in first]
    batch = intake.accept_batch(web.store, "two", [*first, *other, *again], (), course=COURSE, max_attempts=3)
    assert [job.student for job in batch.jobs] == students * 3
    numbers = [job.submission_id for job in batch.jobs]
    of_first, of_other, of_again = numbers[:30], numbers[30:60], numbers[60:]
    assert of_first != sorted(of_first)
    assert [sorted(of_first).index(each) for each in of_first] != [sorted(of_other).index(each) for each in of_other]
    assert all(before < after for before, after in zip(of_first, of_again, strict=True))
    assert [job.attempt for job in batch.jobs] == [1] * 60 + [2] * 30


def test_a_student_has_another_label_in_each_assignment() -> None:
    names = HiddenNames(frozenset({"one", "two"}), b"key")
    assert names.label_student("one", "ada") == names.label_student("one", "ada")
    assert len({names.label_student(assignment, "ada") for assignment in ("one", "two", "named")}) == 3


def test_no_two_students_have_the_same_label_and_no_label_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.store.courses.hidden_names._LABEL_LENGTH", 1)
    students = tuple(f"student-{number}" for number in range(200))
    labels: dict[str, str] = {}
    for count in range(1, len(students) + 1):
        names = HiddenNames(frozenset({"one"}), b"key", students[:count])
        after = {student: names.label_student("one", student) for student in students[:count]}
        assert labels.items() <= after.items()
        labels = after
    assert len(set(labels.values())) == len(students)
    assert {len(label) - len("Participant ") for label in labels.values()} == {1, 12}
    # Letters of 60 bits: the chance that two of 100,000 students have the same ones.
    assert 100_000**2 / 2 / 32**12 < 1e-6
