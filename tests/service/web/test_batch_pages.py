"""Instructors' work with a batch on the web: preview, upload, progress, grades, publication, removal."""

from __future__ import annotations

import codecs
import csv
import io
import os
import re
import time
import zipfile
from dataclasses import replace
from decimal import Decimal

import pytest
from sqlalchemy import event, func, select, update
from starlette.testclient import TestClient

import report_builders
from builders import echo, grading_request
from naming import is_named
from report_builders import HOSTILE
from service.pending_uploads import PendingUpload, PendingUploads
from service.reports.formats import FORMATS
from service.store import audit
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.grades import result_cache
from service.store.installation import load_secret
from service.store.states import BatchState, JobState, Standing
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.people import Enrolment
from service.store.tables.submissions import Batch, Job
from service.version import hash_grader
from submissions.assignment.folder import locate_assignment_folder
from submissions.student_identity import RejectedSubmission, Student
from web import COURSE, Web, grade_all, submit, words
from web_world import make_world
from zips import zipped

HOME = "/courses/1"
ECHO = {"robot.py": "print('hello')\n", "responder.py": "def responder(msg):\n    return msg\n"}


def a_class(*students: str) -> bytes:
    """Return a zip with a folder for each student."""
    return zipped({f"{who}/{name}": text + f"# {who}\n" for who in students for name, text in ECHO.items()})


def sent(grace: TestClient, data: bytes, name: str = "week one.zip", **fields: str) -> str:
    """Upload a batch; return the address of its preflight."""
    files = {"files": (name, data, "application/zip")}
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": "echo-responder", **fields}, files=files)
    assert answer.status_code == 303, words(answer.text)
    return answer.headers["location"]


def a_batch(web: Web, *students: str, refusals: tuple[RejectedSubmission, ...] = ()) -> intake.AcceptedBatch:
    """Create a graded batch."""
    requests = [grading_request(who, f"print({who!r})\n") for who in students]
    made = intake.accept_batch(web.store, "week one", requests, refusals, course=COURSE, max_attempts=3)
    grade_all(web, report_builders.faulty_grade())
    return made


def test_a_batch_is_looked_at_before_it_is_taken_in(web: Web, grace: TestClient) -> None:
    bad = {"eve/notes.txt": "nothing", "</td><script>alert(1)</script>/robot.txt": "x"}
    with zipfile.ZipFile(sink := io.BytesIO(a_class("ada", "bob")), "a") as archive:
        for name, text in bad.items():
            archive.writestr(name, text)
    place = sent(grace, sink.getvalue())
    visible_text = grace.get(place).text
    assert "2 submissions can be accepted. 2 submissions are rejected." in words(visible_text)
    assert "eve" in visible_text
    assert "<script>alert" not in visible_text
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Job)) == 0
    answer = submit(grace, f"{place}/confirm")
    assert answer.status_code == 303
    batch = answer.headers["location"].partition("?")[0]
    page_text = words(grace.get(batch).text)
    for each in ("week one", "2 queued", "2 rejected", "ada", "bob", "eve"):
        assert each in page_text
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Job).where(Job.state == JobState.QUEUED)) == 2
        (entry,) = audit.load_entries(session, "batch", batch.rpartition("/")[2])
        assert (entry.action, entry.actor) == ("submit", "Grace (person 1)")
        assert entry.detail["refused"] == 2
    assert grace.get(place).status_code == 404
    again = submit(grace, f"{sent(grace, sink.getvalue())}/confirm")
    assert "No new submissions." in words(again.text)


def test_what_is_missing_known_and_new_is_said_before_it_is_taken_in(web: Web, grace: TestClient) -> None:
    web.student("ada")
    web.student("bob")
    submit(grace, f"{sent(grace, a_class('ada'))}/confirm")
    grade_all(web, report_builders.faulty_grade())
    secret = load_secret(web.store).sha256
    with web.store.transaction() as session:
        job = session.query(Job).one()
        job.sandbox = "seccomp, Landlock"
        job.cache_key = result_cache.compute_cache_key(session, job.id, hash_grader(), secret)
        for trial in session.query(TrialRow):
            trial.verdict = "finished"
    alike = {f"{who}/{name}": f"{text}# ada\n" for who in ("ada", "bob") for name, text in ECHO.items()}
    page_text = words(grace.get(sent(grace, zipped(alike | {"eve/robot.py": "print(1)\n"}))).text)
    assert "1 submission has no responder.py and gets no marks for the criteria that need it: eve" in page_text
    assert "1 student is not enrolled yet and will be enrolled: eve" in page_text
    assert "1 submission was submitted before and stays unchanged" in page_text
    assert "1 submission is identical to a graded submission" in page_text


def test_files_of_their_own_and_a_table_of_people(web: Web, grace: TestClient) -> None:
    parts = [("files", (f"{who}.zip", zipped(ECHO | {"note.txt": who}))) for who in ("ada", "bob")]
    people = ("people", ("class.csv", b"id,name\nada,Ada Lovelace\n"))
    data = {"assignment": "echo-responder"}
    answer = submit(grace, f"{HOME}/batches/uploads", data, files=[*parts, people])
    page_text = words(grace.get(answer.headers["location"]).text)
    assert "1 submission can be accepted. 1 submission is rejected." in page_text
    assert "Ada Lovelace" in page_text
    assert "bob is not in class.csv" in page_text


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("week.zip", b"no zip at all", "cannot be unpacked"),
        ("week.zip", zipped({"../../evil/robot.py": "x"}), "outside"),
        ("week.zip", zipped(ECHO), "one submission"),
        ("week.tar.gz", b"x", "week.tar.gz was uploaded"),
        ("week.csv", b"student,file\nada,/etc/passwd\n", "week.csv was uploaded"),
    ],
)
def test_what_is_no_batch_is_refused_in_a_sentence_and_not_kept(
    web: Web, grace: TestClient, name: str, data: bytes, says: str
) -> None:
    files = {"files": (name, data, "application/zip")}
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": "echo-responder"}, files=files)
    assert answer.status_code == 422
    assert says in words(answer.text)
    assert list((web.settings.home / "uploads").iterdir()) == []


def test_an_upload_is_its_senders_alone_and_few_are_kept(web: Web, grace: TestClient) -> None:
    places = [sent(grace, a_class(f"s{number}")) for number in range(5)]
    assert [grace.get(place).status_code for place in places] == [404, 404, 200, 200, 200]
    other = web.browser(web.instructor("mallory"))
    assert other.get(places[4]).status_code == 404
    assert submit(other, f"{places[4]}/confirm").status_code == 404
    for folder in (web.settings.home / "uploads").iterdir():
        assert folder.stat().st_mode & 0o077 == 0
    assert submit(grace, f"{places[4]}/discard").status_code == 303
    assert grace.get(places[4]).status_code == 404
    assert len(list((web.settings.home / "uploads").iterdir())) == 2
    assert [each.get(f"{HOME}/batches").text.count("/batches/uploads/") for each in (grace, other)] == [2, 0]


def test_waiting_uploads_of_others_prevent_no_upload(web: Web, grace: TestClient) -> None:
    uploads = PendingUploads(web.settings.home)
    waiting = [uploads.begin(1000 + number // 3, 1, "echo-responder") for number in range(28)]
    for age, each in enumerate(reversed(waiting)):
        at = time.time() - 1 - age
        os.utime(web.settings.home / "uploads" / each.id, (at, at))
    places = [sent(grace, a_class(f"s{number}")) for number in range(3)]
    assert [grace.get(place).status_code for place in places] == [200, 200, 200]
    assert [uploads.find(each.id, each.person_id, 1) is not None for each in waiting] == [False] + [True] * 27
    # The person with the single upload keeps it.
    uploads.begin(2000, 1, "echo-responder")
    assert uploads.find(waiting[-1].id, waiting[-1].person_id, 1) is not None
    assert len(list((web.settings.home / "uploads").iterdir())) == 30


def test_an_upload_that_was_removed_meanwhile_is_refused(
    web: Web, grace: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = PendingUploads.begin

    def begin_removed(uploads: PendingUploads, person_id: int, course_id: int, assignment: str) -> PendingUpload:
        made = begin(uploads, person_id, course_id, assignment)
        uploads.remove(made)
        return made

    monkeypatch.setattr(PendingUploads, "begin", begin_removed)
    files = {"files": ("a.zip", a_class("ada"), "application/zip")}
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": "echo-responder"}, files=files)
    assert (answer.status_code, "upload the files again" in words(answer.text)) == (422, True)


def test_uploads_may_vanish_while_another_begins(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    uploads = PendingUploads(web.settings.home)
    first = uploads.begin(1, 1, "a")
    read = PendingUploads._read_metadata

    def read_and_remove(self: PendingUploads, upload_id: str) -> PendingUpload | None:
        upload = read(self, upload_id)
        uploads.remove(first)
        return upload

    monkeypatch.setattr(PendingUploads, "_read_metadata", read_and_remove)
    second = uploads.begin(2, 1, "a")
    assert [path.name for path in (web.settings.home / "uploads").iterdir()] == [second.id]


def test_the_assignment_is_the_courses_own_where_it_has_one_and_never_a_folder(web: Web, grace: TestClient) -> None:
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(replace(echo(), title="Echo, changed")))
    assert "Echo, changed" in grace.get(sent(grace, a_class("ada"))).text
    files = {"files": ("w.zip", a_class("ada"), "application/zip")}
    folder = str(locate_assignment_folder("echo-responder"))
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": folder}, files=files)
    assert answer.status_code == 422


@pytest.mark.long
def test_the_table_is_sorted_filtered_searched_and_cut(web: Web, grace: TestClient) -> None:
    refusals = (RejectedSubmission("late.zip", "is empty, expected files.", Student("late")),)
    requests = [grading_request(f"s{number:03}") for number in range(120)]
    made = intake.accept_batch(web.store, "week", requests, refusals, course=COURSE, max_attempts=3)
    with web.store.transaction() as session:
        for place, job in enumerate(made.jobs):
            row = session.get_one(Job, job.job_id)
            row.state, row.verdict, row.marks, row.max_marks = JobState.DONE, "finished", Decimal(place), Decimal(200)
        dead = session.get_one(Job, made.jobs[7].job_id)
        dead.state, dead.marks, dead.error = JobState.DEAD, None, HOSTILE
    path = f"{HOME}/batches/{made.id}"

    def rows(query: str) -> list[str]:
        page = grace.get(f"{path}?{query}").text
        return re.findall(r'<th scope="row">(?:<a [^>]*>)?([^<]*)', page[page.find("<tbody") :])

    assert rows("") == ["late", *(f"s{number:03}" for number in range(99))]
    assert rows("page=2") == [f"s{number:03}" for number in range(99, 120)]
    assert rows("page=2&sort=-student")[-1] == "late"
    assert rows("state=refused") == ["late"]
    assert rows("state=dead") == ["s007"]
    assert rows("q=S11") == [f"s{number}" for number in range(110, 120)]
    assert rows("q=nobody") == []
    assert rows("sort=-marks")[:2] == ["s119", "s118"]
    assert rows("sort=marks")[2:4] == ["s000", "s001"]
    page = grace.get(f"{path}?state=nonsense&sort=;drop&q=%3Cscript%3E").text
    assert "<script>alert" not in page
    assert 'value="&lt;script&gt;"' in page


def test_the_pages_of_a_batch_ask_the_database_no_more_of_many_than_of_few(web: Web, grace: TestClient) -> None:
    few, many = a_batch(web, "ada"), a_batch(web, *(f"s{number}" for number in range(12)))
    statements: list[str] = []
    event.listen(
        web.store.engine, "before_cursor_execute", lambda *event_arguments: statements.append(event_arguments[2])
    )

    def counted(path: str) -> int:
        statements.clear()
        assert grace.get(path).status_code == 200
        return len(statements)

    for part in ("", "/overview", "/progress"):
        counts = [counted(f"{HOME}/batches/{made.id}{part}") for made in (few, many)]
        assert counts[0] == counts[1], part
    assert counted(f"{HOME}/batches") < 15


def test_progress_tells_how_far_it_is_and_asks_for_the_page_at_the_end(web: Web, grace: TestClient) -> None:
    requests = [grading_request(who) for who in ("ada", "bob")]
    made = intake.accept_batch(web.store, "week one", requests, (), course=COURSE, max_attempts=3)
    path = f"{HOME}/batches/{made.id}"
    first = grace.get(f"{path}/progress", headers={"hx-request": "true"})
    assert 'hx-trigger="every 2s"' in first.text
    assert "hx-refresh" not in first.headers
    assert '<meta http-equiv="refresh"' in grace.get(path).text
    grade_all(web, report_builders.faulty_grade())
    last = grace.get(f"{path}/progress", headers={"hx-request": "true"})
    assert last.headers["hx-refresh"] == "true"
    assert "hx-trigger" not in last.text
    assert '<meta http-equiv="refresh"' not in grace.get(path).text


def test_a_batch_is_paused_let_go_on_cancelled_and_retried(web: Web, grace: TestClient) -> None:
    made = intake.accept_batch(web.store, "week", [grading_request("ada")], (), course=COURSE, max_attempts=3)
    path = f"{HOME}/batches/{made.id}"

    def state() -> BatchState:
        with web.store.reading() as session:
            return session.get_one(Batch, made.id).state

    for action, then in (("pause", BatchState.PAUSED), ("resume", BatchState.OPEN)):
        answer = submit(grace, f"{path}/{action}")
        assert (answer.status_code, state()) == (303, then)
        assert "Grace (person 1)" in grace.get(answer.headers["location"]).text
    with web.store.transaction() as session:
        job = session.get_one(Job, made.jobs[0].job_id)
        job.state, job.error = JobState.DEAD, "the worker ended"
    assert "the worker ended" in grace.get(path).text
    submit(grace, f"{path}/retry")
    with web.store.reading() as session:
        assert session.get_one(Job, made.jobs[0].job_id).state is JobState.QUEUED
    submit(grace, f"{path}/cancel")
    assert state() is BatchState.CANCELLED
    assert submit(grace, f"{path}/pause").status_code == 422


def test_what_a_newer_submission_took_the_place_of_leads_to_it(web: Web, grace: TestClient) -> None:
    old, new = (
        intake.accept_batch(
            web.store, name, [grading_request("ada", f"print({name!r})\n")], (), course=COURSE, max_attempts=3
        )
        for name in ("week one", "week two")
    )
    newer = f"{HOME}/grades/{new.jobs[0].job_id}"
    batch, grade = (grace.get(f"{HOME}/{path}").text for path in (f"batches/{old.id}", f"grades/{old.jobs[0].job_id}"))
    assert f'href="{newer}"' in batch
    assert "submitted in another batch" in batch
    assert f'<a href="{newer}">replaced by a newer submission</a>' in grade
    assert "superseded by" not in batch + grade


def test_the_overview_says_what_was_lost_by_whom_and_who_is_missing(web: Web, grace: TestClient) -> None:
    web.student("zoe")
    made = a_batch(web, "ada", "bob", refusals=(RejectedSubmission("x.zip", "is broken, expected a zip."),))
    page_text = words(grace.get(f"{HOME}/batches/{made.id}/overview").text)
    for each in ("Graded 2", "Most common causes", "Not submitted Zoe", "x.zip is broken", "Find similar submissions"):
        assert each in page_text, page_text
    assert "Grace" not in page_text.partition("Not submitted")[2][:40]
    everybody = grace.get(f"{HOME}/batches/{made.id}/overview?pass=0").text
    assert "Passed (0 per cent or more) 2 (100 %)" in words(everybody)


def test_the_overview_shows_how_good_the_task_is_in_both_languages(web: Web, grace: TestClient) -> None:
    """Twelve students have the same marks, so no criterion has a discrimination."""
    small = a_batch(web, "ada", "bob")
    page_text = words(grace.get(f"{HOME}/batches/{small.id}/overview").text)
    assert "Figures on the task need at least 10 graded submissions; there are 2." in page_text
    made = a_batch(web, *(f"s{number}" for number in range(12)))
    path = f"{HOME}/batches/{made.id}/overview"
    page_text = words(grace.get(path).text)
    for each in (
        "How good is the task? ",
        "none of 12 submissions has any marks. Check the task and the criterion.",
        "Criterion Facility Discrimination Intended weight Effective weight",
        "0 % (0 – 0) – ",
    ):
        assert each in page_text, page_text
    assert "Keine von 12 Abgaben hat Punkte." in words(grace.get(path, headers={"accept-language": "de"}).text)


def test_what_is_nearly_the_same_is_shown_with_its_lines_across_the_batches_of_a_course(
    web: Web, grace: TestClient
) -> None:
    step = "def step_{}(value):\n    total = value * 3 {} 4\n    return [total, {!r}]\n"
    lines = [step.format(name, sign, HOSTILE) for name in "abc" for sign in "+-%"]
    own = "".join(lines) + "".join(f"while left.distance < {number}: right.on(30)\n" for number in range(12))
    for student, program in (("ada", own), ("bob", own.replace("step", "go").replace("total", "sum"))):
        request = grading_request(student, program)
        made = intake.accept_batch(web.store, f"of {student}", [request], (), course=COURSE, max_attempts=3)
    grade_all(web, report_builders.faulty_grade())
    path = f"{HOME}/batches/{made.id}/similar"
    page = grace.get(path).text
    assert "1 similar pair among 2 students" in words(page)
    # Groups with the same file, groups with the same recordings, and the pair.
    assert len(re.findall(rf'href="{HOME}/grades/\w+">ada', page)) == 3
    assert page.count("<details open>") == page.count("<details") == 1
    assert "sum = value * 3" in page
    assert "<script>alert" not in page
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", names_hidden=True)
    hidden = words(grace.get(path).text)
    assert "1 similar pair" in hidden
    assert not is_named("ada", hidden)
    answer = grace.get(f"/api/v1{path}", headers=web.token(web.instructor(), "read"))
    (document,) = answer.json()["assignments"]
    (pair,) = document["pairs"]
    assert pair["share"] > 0.9
    assert {each["aspect"] for each in pair["trials"]} <= {"path", "messages", "faults"}
    assert all(student.startswith("Participant ") for student in pair["students"])


def test_publishing_all_and_publishing_one(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob")
    one, other = (job.job_id for job in made.jobs)
    answer = submit(grace, f"{HOME}/grades/{one}/publish")
    assert "Grade published" in grace.get(answer.headers["location"]).text
    with web.store.reading() as session:
        assert session.get_one(Job, one).published_by == "Grace (person 1)"
        assert session.get_one(Job, other).published_at is None
        assert [entry.action for entry in audit.load_entries(session, "job", one)] == ["publish"]
    german = grace.get(f"{HOME}/grades/{one}", headers={"accept-language": "de"}).text
    assert re.search(r"Grace \(person 1\): veröffentlicht</li>", german)
    answer = submit(grace, f"{HOME}/batches/{made.id}/publish")
    assert "1 grade published." in words(grace.get(answer.headers["location"]).text)
    with web.store.reading() as session:
        assert session.get_one(Job, other).published_at is not None


def test_a_batch_and_one_of_it_are_graded_again_and_stand_when_published(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob")
    answer = submit(grace, f"{HOME}/batches/{made.id}/regrade")
    changes = answer.headers["location"]
    assert changes.endswith("/changes")
    grade_all(web, report_builders.faulty_grade())
    assert "For 0 of 2 submissions, the marks changed" in words(grace.get(changes).text)
    first = made.jobs[0].job_id
    answer = submit(grace, f"{HOME}/grades/{first}/regrade", {"assignment": "echo-responder"})
    second = answer.headers["location"].rpartition("/")[2]
    assert "This submission is queued." in grace.get(answer.headers["location"]).text
    grade_all(web, report_builders.faulty_grade())
    page_text = words(grace.get(answer.headers["location"]).text)
    assert "Regraded:" in page_text
    assert "Grading history" in page_text
    submit(grace, f"{HOME}/grades/{second}/publish")
    with web.store.reading() as session:
        assert session.get_one(Job, second).standing is Standing.STANDS
        assert session.get_one(Job, first).standing is Standing.KEPT
    assert submit(grace, f"{HOME}/grades/{second}/regrade", {"assignment": "stay-inside"}).status_code == 422


def test_the_page_of_changes_begins_with_a_summary_of_causes_and_boundaries(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob")
    changes = submit(grace, f"{HOME}/batches/{made.id}/regrade").headers["location"]
    grade = report_builders.faulty_grade()
    grade_all(web, replace(grade, criteria=tuple(replace(each, marks=each.max_marks) for each in grade.criteria)))
    text = words(grace.get(f"{changes}?pass=100").text)
    assert re.search("Higher share of marks 2 Lower share of marks 0 Same share of marks 0 Now passed 2", text), text
    assert "unexplained Assignment and release are the same." in text
    assert text.count("boundary crossed") == 2
    german = words(grace.get(changes, headers={"accept-language": "de"}).text)
    assert "ungeklärt" in german
    assert "unexplained" not in german


def test_a_grade_is_shown_to_staff_with_its_neighbours(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob", "cid")
    ids = {job.student: job.job_id for job in made.jobs}
    page_text = grace.get(f"{HOME}/grades/{ids['bob']}").text
    assert "staff only" in page_text
    assert f'href="{HOME}/grades/{ids["ada"]}" rel="prev"' in page_text
    assert f'href="{HOME}/grades/{ids["cid"]}" rel="next"' in page_text
    assert 'rel="prev"' not in grace.get(f"{HOME}/grades/{ids['ada']}").text
    german = grace.get(f"{HOME}/grades/{ids['bob']}", headers={"accept-language": "de"}).text
    assert '<p class="next" data-before="Als Nächstes:">Beheben Sie das in Ihrem Antwortprogramm' in german
    assert '"play": "Abspielen"' in german
    assert "staff only" not in german


def test_hidden_names_are_nowhere_on_the_pages_of_who_marks(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada-lovelace", "bob-kahn")
    with web.store.transaction() as session:
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
    submit(grace, f"{HOME}/assignments/echo-responder/names", {"hidden": "true"})
    path = f"{HOME}/batches/{made.id}"
    pages = [path, f"{path}/overview", f"{HOME}/grades/{made.jobs[0].job_id}"]
    regrade = submit(grace, f"{path}/regrade").headers["location"]
    for each in (*pages, regrade):
        text = grace.get(each).text
        assert not is_named("lovelace", text), each
        assert not is_named("kahn", text), each
    assert len(set(re.findall(r"Participant \w{6}", grace.get(path).text))) == 2
    assert "0 rows" in words(grace.get(f"{path}?q=ada-lovelace").text)
    with web.store.reading() as session:
        enrolment = session.scalar(select(Enrolment.id).where(Enrolment.student == "ada-lovelace"))
    assert "/grades/" not in grace.get(f"{HOME}/people/{enrolment}").text
    submit(grace, f"{HOME}/assignments/echo-responder/names", {"hidden": "false"})
    assert "ada-lovelace" in grace.get(path).text


@pytest.mark.long
def test_marks_are_taken_away_as_files(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "=cmd()", "bob")
    path = f"{HOME}/batches/{made.id}"
    answer = grace.get(f"{path}/export?format=csv")
    assert answer.headers["content-disposition"].startswith('attachment; filename="week_one-csv.csv"')
    assert answer.content.startswith(codecs.BOM_UTF8)  # otherwise Excel does not detect UTF-8
    rows = list(csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig"))))
    assert [row["student"] for row in rows] == ["'=cmd()", "bob"]
    assert rows[0]["marks"]
    answer = grace.get(f"{path}/export?format=csv&published=true")
    published = list(csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig"))))
    assert {row["marks"] for row in published} == {""}
    for name, each in FORMATS.items():
        if each.worksheet is None and each.archive is None:
            answer = grace.get(f"{path}/export?format={name}")
            assert answer.status_code == 200, name
            assert answer.headers["content-disposition"].startswith("attachment"), name
    assert grace.get(f"{path}/export?format=../../etc").status_code == 422
    answer = grace.get(f"{path}/export?format=moodle-feedback")
    assert (answer.status_code, "came from Moodle" in words(answer.text)) == (
        422,
        True,
    )


@pytest.mark.long
def test_a_provisional_grade_is_marked_in_lists_and_held_back(web: Web) -> None:
    world = make_world(web)
    grace, batch = web.browser(world.grace), f"/courses/1/batches/{world.values['batch_id']}"
    assert "provisional" not in words(grace.get(batch).text)
    pool = {"size": 200, "drawn": 4, "least": 0.1, "most": 0.9, "is_decided": False}
    with web.store.transaction() as session:
        session.execute(update(Job).values(provisional=True))
        session.execute(update(CriterionResultRow).values(pool=pool))
    assert "provisional" in words(grace.get(batch).text)
    assert "provisional" in words(grace.get(f"/courses/1/grades/{world.values['job_id']}").text)
    preview = words(grace.get(f"{batch}/publish").text)
    assert "1 grade is provisional: not all trials were run yet (running them takes" in preview
    appeal = words(web.browser(world.ada).get("/courses/1/mine/submissions/1/appeal").text)
    assert "Run all trials now" in appeal
    assert "They can be higher or lower." in appeal
    answer = submit(grace, "/courses/1/policy/completion-rule", {"completion_rule": "exact"})
    assert '<option value="exact" selected>' in grace.get(answer.headers["location"]).text
    submit(grace, "/courses/1/policy/completion-rule", {"completion_rule": "higher"})
