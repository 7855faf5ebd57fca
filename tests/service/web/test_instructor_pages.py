"""What instructors do on their pages: batches from upload to publication, assignments, people, and hidden names."""

from __future__ import annotations

import codecs
import csv
import io
import re
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal
from html import unescape
from pathlib import Path

import pytest
from httpx2 import Response
from sqlalchemy import event, func, select
from starlette.testclient import TestClient

import report_builders
from builders import echo, grading_request
from report_builders import HOSTILE
from service.reports.formats import FORMATS
from service.store import audit
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.versions import freeze
from service.store.grades import result_cache, results
from service.store.installation import secret_of
from service.store.models import Batch, Enrolment, Job, SubmissionRow, TrialRow
from service.store.people import people
from service.store.queue import jobs
from service.store.states import BatchState, JobState, Role, Standing
from service.version import grader_sha256
from submissions.assignment.folder import assignment_folder, catalogue
from submissions.people import Refusal, Student
from web import COURSE, Web, submit, web_in

HOME = "/courses/1"
ECHO = {"robot.py": "print('hello')\n", "responder.py": "def responder(msg):\n    return msg\n"}


@pytest.fixture
def web(tmp_path: Path) -> Iterator[Web]:
    with web_in(tmp_path) as made:
        yield made


@pytest.fixture
def grace(web: Web) -> TestClient:
    return web.browser(web.instructor())


def zipped(files: Mapping[str, str]) -> bytes:
    """A zip of texts."""
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return sink.getvalue()


def a_class(*students: str) -> bytes:
    """A zip with a folder for each student."""
    return zipped({f"{who}/{name}": text + f"# {who}\n" for who in students for name, text in ECHO.items()})


def sent(grace: TestClient, data: bytes, name: str = "week one.zip", **fields: str) -> str:
    """Upload a batch; where its preflight is."""
    files = {"files": (name, data, "application/zip")}
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": "echo-responder", **fields}, files=files)
    assert answer.status_code == 303, words(answer.text)
    return answer.headers["location"]


def words(html: str) -> str:
    """What a page says."""
    body = html[html.find("<main") :]
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", body)).split())


def grade_all(web: Web) -> None:
    """What waits is graded at once, by hand."""
    while claim := jobs.claim(web.store, "worker", 60):
        jobs.finish(web.store, claim, results.prepare(report_builders.faulty_grade()), datetime.now(UTC))


def a_batch(web: Web, *students: str, refusals: tuple[Refusal, ...] = ()) -> intake.AcceptedBatch:
    """A graded batch."""
    requests = [grading_request(who, f"print({who!r})\n") for who in students]
    made = intake.accept_batch(web.store, "week one", requests, refusals, course=COURSE, max_attempts=3)
    grade_all(web)
    return made


def test_a_batch_is_looked_at_before_it_is_taken_in(web: Web, grace: TestClient) -> None:
    bad = {"eve/notes.txt": "nothing", "</td><script>alert(1)</script>/robot.txt": "x"}
    with zipfile.ZipFile(sink := io.BytesIO(a_class("ada", "bob")), "a") as archive:
        for name, text in bad.items():
            archive.writestr(name, text)
    place = sent(grace, sink.getvalue())
    shown = grace.get(place).text
    assert "2 submissions can be taken in. 2 are refused." in words(shown)
    assert "eve" in shown
    assert "<script>alert" not in shown
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Job)) == 0
    answer = submit(grace, f"{place}/confirm")
    assert answer.status_code == 303
    batch = answer.headers["location"].partition("?")[0]
    told = words(grace.get(batch).text)
    for each in ("week one", "2 waits", "2 refused", "ada", "bob", "eve"):
        assert each in told
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(Job).where(Job.state == JobState.QUEUED)) == 2
        (entry,) = audit.entries(session, "batch", batch.rpartition("/")[2])
        assert (entry.action, entry.actor) == ("submit", "Grace (person 1)")
        assert entry.detail["refused"] == 2
    assert grace.get(place).status_code == 404
    again = submit(grace, f"{sent(grace, sink.getvalue())}/confirm")
    assert "Nothing of it is new" in words(again.text)


def test_what_is_missing_known_and_new_is_said_before_it_is_taken_in(web: Web, grace: TestClient) -> None:
    web.student("ada")
    web.student("bob")
    submit(grace, f"{sent(grace, a_class('ada'))}/confirm")
    grade_all(web)
    secret = secret_of(web.store).sha256
    with web.store.transaction() as session:
        job = session.query(Job).one()
        job.sandbox = "seccomp, Landlock"
        job.cache_key = result_cache.cache_key(session, job.id, grader_sha256(), secret)
        for trial in session.query(TrialRow):
            trial.verdict = "finished"
    alike = {f"{who}/{name}": f"{text}# ada\n" for who in ("ada", "bob") for name, text in ECHO.items()}
    shown = words(grace.get(sent(grace, zipped(alike | {"eve/robot.py": "print(1)\n"}))).text)
    assert "1 has no responder.py, and what needs it has no marks: eve" in shown
    assert "1 is not in the course yet, and will be: eve" in shown
    assert "1 was submitted before just so" in shown
    assert "1 is identical to one that is graded" in shown


def test_files_of_their_own_and_a_table_of_people(web: Web, grace: TestClient) -> None:
    parts = [("files", (f"{who}.zip", zipped(ECHO | {"note.txt": who}))) for who in ("ada", "bob")]
    people = ("people", ("class.csv", b"id,name\nada,Ada Lovelace\n"))
    data = {"assignment": "echo-responder"}
    answer = submit(grace, f"{HOME}/batches/uploads", data, files=[*parts, people])
    shown = words(grace.get(answer.headers["location"]).text)
    assert "1 submission can be taken in. 1 is refused." in shown
    assert "Ada Lovelace" in shown
    assert "bob is not in class.csv" in shown


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("week.zip", b"no zip at all", "cannot be unpacked"),
        ("week.zip", zipped({"../../evil/robot.py": "x"}), "outside"),
        ("week.zip", zipped(ECHO), "one submission"),
        ("week.tar.gz", b"x", "week.tar.gz was sent"),
        ("week.csv", b"student,file\nada,/etc/passwd\n", "week.csv was sent"),
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


def test_the_assignment_is_the_courses_own_where_it_has_one_and_never_a_folder(web: Web, grace: TestClient) -> None:
    with web.store.transaction() as session:
        open_assignments.prepare(session, 1, freeze(replace(echo(), title="Echo, changed")))
    assert "Echo, changed" in grace.get(sent(grace, a_class("ada"))).text
    files = {"files": ("w.zip", a_class("ada"), "application/zip")}
    folder = str(assignment_folder("echo-responder"))
    answer = submit(grace, f"{HOME}/batches/uploads", {"assignment": folder}, files=files)
    assert answer.status_code == 422


def test_the_table_is_sorted_filtered_searched_and_cut(web: Web, grace: TestClient) -> None:
    refusals = (Refusal("late.zip", "is empty, expected files.", Student("late")),)
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
    asked: list[str] = []
    event.listen(web.store.engine, "before_cursor_execute", lambda *said: asked.append(said[2]))

    def counted(path: str) -> int:
        asked.clear()
        assert grace.get(path).status_code == 200
        return len(asked)

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
    grade_all(web)
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


def test_the_overview_says_what_was_lost_by_whom_and_who_is_missing(web: Web, grace: TestClient) -> None:
    web.student("zoe")
    made = a_batch(web, "ada", "bob", refusals=(Refusal("x.zip", "is broken, expected a zip."),))
    told = words(grace.get(f"{HOME}/batches/{made.id}/overview").text)
    for each in ("Graded 2", "Commonest causes", "Not submitted Zoe", "x.zip is broken", "nearly the same"):
        assert each in told, told
    assert "Grace" not in told.partition("Not submitted")[2][:40]
    everybody = grace.get(f"{HOME}/batches/{made.id}/overview?pass=0").text
    assert "With 0 per cent or more 2 (100 %)" in words(everybody)


def test_what_is_nearly_the_same_is_shown_with_its_lines_across_the_batches_of_a_course(
    web: Web, grace: TestClient
) -> None:
    step = "def step_{}(value):\n    total = value * 3 {} 4\n    return [total, {!r}]\n"
    lines = [step.format(name, sign, HOSTILE) for name in "abc" for sign in "+-%"]
    own = "".join(lines) + "".join(f"while left.distance < {number}: right.on(30)\n" for number in range(12))
    for student, program in (("ada", own), ("bob", own.replace("step", "go").replace("total", "sum"))):
        request = grading_request(student, program)
        made = intake.accept_batch(web.store, f"of {student}", [request], (), course=COURSE, max_attempts=3)
    grade_all(web)
    path = f"{HOME}/batches/{made.id}/similar"
    page = grace.get(path).text
    assert "1 pair is alike among 2 students" in words(page)
    assert len(re.findall(rf'href="{HOME}/grades/\w+">ada', page)) == 2
    assert page.count("<details open>") == page.count("<details") == 1
    assert "sum = value * 3" in page
    assert "<script>alert" not in page
    with web.store.transaction() as session:
        open_assignments.prepare(session, 1, freeze(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", hidden=True)
    hidden = words(grace.get(path).text)
    assert "1 pair is alike" in hidden
    assert "ada" not in hidden
    answer = grace.get(f"/api/v1{path}", headers=web.token(web.instructor(), "read"))
    (found,) = answer.json()["assignments"]
    (pair,) = found["pairs"]
    assert pair["share"] > 0.9
    assert {each["aspect"] for each in pair["trials"]} <= {"path", "messages", "faults"}
    assert all(student.startswith("Participant ") for student in pair["students"])


def test_publishing_all_and_publishing_one(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob")
    one, other = (job.job_id for job in made.jobs)
    answer = submit(grace, f"{HOME}/grades/{one}/publish")
    assert "This grade is published" in grace.get(answer.headers["location"]).text
    with web.store.reading() as session:
        assert session.get_one(Job, one).published_by == "Grace (person 1)"
        assert session.get_one(Job, other).published_at is None
        assert [entry.action for entry in audit.entries(session, "job", one)] == ["publish"]
    answer = submit(grace, f"{HOME}/batches/{made.id}/publish")
    assert "1 grade is published now" in words(grace.get(answer.headers["location"]).text)
    with web.store.reading() as session:
        assert session.get_one(Job, other).published_at is not None


def test_a_batch_and_one_of_it_are_graded_again_and_stand_when_published(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob")
    answer = submit(grace, f"{HOME}/batches/{made.id}/regrade")
    changes = answer.headers["location"]
    assert changes.endswith("/changes")
    grade_all(web)
    assert "0 of 2 have other marks" in words(grace.get(changes).text)
    first = made.jobs[0].job_id
    answer = submit(grace, f"{HOME}/grades/{first}/regrade", {"assignment": "echo-responder"})
    second = answer.headers["location"].rpartition("/")[2]
    assert "It waits to be graded." in grace.get(answer.headers["location"]).text
    grade_all(web)
    shown = words(grace.get(answer.headers["location"]).text)
    assert "Graded again:" in shown
    assert "Graded more than once" in shown
    submit(grace, f"{HOME}/grades/{second}/publish")
    with web.store.reading() as session:
        assert session.get_one(Job, second).standing is Standing.STANDS
        assert session.get_one(Job, first).standing is Standing.KEPT
    assert submit(grace, f"{HOME}/grades/{second}/regrade", {"assignment": "stay-inside"}).status_code == 422


def test_a_grade_is_shown_to_staff_with_its_neighbours(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada", "bob", "cid")
    ids = {job.student: job.job_id for job in made.jobs}
    shown = grace.get(f"{HOME}/grades/{ids['bob']}").text
    assert "staff copy" in shown
    assert f'href="{HOME}/grades/{ids["ada"]}" rel="prev"' in shown
    assert f'href="{HOME}/grades/{ids["cid"]}" rel="next"' in shown
    assert 'rel="prev"' not in grace.get(f"{HOME}/grades/{ids['ada']}").text
    german = grace.get(f"{HOME}/grades/{ids['bob']}", headers={"accept-language": "de"}).text
    assert '<p class="next" data-before="Als Nächstes:">Rufen Sie' in german
    assert '"play": "Abspielen"' in german
    assert "staff copy" not in german


def test_hidden_names_are_nowhere_on_the_pages_of_who_marks(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "ada-lovelace", "bob-kahn")
    with web.store.transaction() as session:
        open_assignments.prepare(session, 1, freeze(echo()))
    submit(grace, f"{HOME}/assignments/echo-responder/names", {"hidden": "true"})
    path = f"{HOME}/batches/{made.id}"
    pages = [path, f"{path}/overview", f"{HOME}/grades/{made.jobs[0].job_id}"]
    regrade = submit(grace, f"{path}/regrade").headers["location"]
    for each in (*pages, regrade):
        text = grace.get(each).text
        assert "lovelace" not in text, each
        assert "kahn" not in text, each
    assert len(set(re.findall(r"Participant \w{6}", grace.get(path).text))) == 2
    assert "0 rows" in words(grace.get(f"{path}?q=ada-lovelace").text)
    with web.store.reading() as session:
        enrolment = session.scalar(select(Enrolment.id).where(Enrolment.student == "ada-lovelace"))
    assert "/grades/" not in grace.get(f"{HOME}/people/{enrolment}").text
    submit(grace, f"{HOME}/assignments/echo-responder/names", {"hidden": "false"})
    assert "ada-lovelace" in grace.get(path).text


def test_marks_are_taken_away_as_files(web: Web, grace: TestClient) -> None:
    made = a_batch(web, "=cmd()", "bob")
    path = f"{HOME}/batches/{made.id}"
    answer = grace.get(f"{path}/export?format=csv")
    assert answer.headers["content-disposition"].startswith('attachment; filename="week_one-csv.csv"')
    assert answer.content.startswith(codecs.BOM_UTF8)  # or Excel does not take it for UTF-8
    rows = list(csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig"))))
    assert [row["student"] for row in rows] == ["'=cmd()", "bob"]
    assert rows[0]["marks"]
    answer = grace.get(f"{path}/export?format=csv&published=true")
    published = list(csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig"))))
    assert {row["marks"] for row in published} == {""}
    for name, each in FORMATS.items():
        if each.filled_in is None and each.packed is None:
            answer = grace.get(f"{path}/export?format={name}")
            assert answer.status_code == 200, name
            assert answer.headers["content-disposition"].startswith("attachment"), name
    assert grace.get(f"{path}/export?format=../../etc").status_code == 422
    answer = grace.get(f"{path}/export?format=moodle-feedback")
    assert (answer.status_code, "came from Moodle" in words(answer.text)) == (
        422,
        True,
    )


def test_an_assignment_is_prepared_opened_and_closed(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    assert submit(grace, path, {"assignment": "echo-responder"}).headers["location"] == f"{path}/echo-responder"
    for action, is_open in (("open", True), ("close", False), ("open", True)):
        submit(grace, f"{path}/echo-responder/{action}")
        with web.store.reading() as session:
            assert open_assignments.find(session, 1, "echo-responder").open is is_open
    policy = {"assignment": "echo-responder", "due": "2026-11-30T17:00", "late_days": "2", "attempts": "3"}
    submit(grace, f"{HOME}/policy", policy)
    shown = grace.get(f"{path}/echo-responder").text
    assert 'value="2026-11-30T17:00"' in shown
    with web.store.reading() as session:
        allowed = policies.policies(session, 1)["echo-responder"]
        done = [entry.action for entry in audit.entries(session, "course", "1")]
    assert (allowed.late_days, allowed.attempts) == (2, 3)
    submit(grace, f"{HOME}/policy", policy | {"due": "2020-11-30T17:00"})
    told = words(grace.get(f"{path}/echo-responder?done=policy").text)
    assert "Set." in told
    assert "This date has passed" in told
    submit(grace, f"{path}/echo-responder/no-policy")
    assert "It has no dates and attempts of its own" in words(grace.get(f"{path}/echo-responder").text)
    assert done == ["prepare", "open", "close", "open", "policy"]
    assert submit(grace, f"{HOME}/policy", {"due": "soon"}).status_code == 422
    assert submit(grace, path, {"assignment": "/etc"}).status_code == 422


def test_an_assignment_that_nobody_was_shown_is_taken_out(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    one = f"{path}/echo-responder"
    submit(grace, path, {"assignment": "echo-responder"})
    submit(grace, f"{HOME}/policy", {"assignment": "echo-responder", "due": "2026-11-30T17:00"})
    submit(grace, f"{one}/names", {"hidden": "true"})
    assert "Take out of the course" not in grace.get(one).text
    assert "names that are hidden would be shown" in words(submit(grace, f"{one}/remove").text)
    submit(grace, f"{one}/names", {"hidden": "false"})
    assert "Take out of the course" in grace.get(one).text
    assert submit(grace, f"{one}/remove").headers["location"] == path
    assert "There is none yet" in grace.get(path).text
    assert submit(grace, f"{one}/remove").status_code == 422
    with web.store.reading() as session:
        assert policies.policies(session, 1) == {}
    submit(grace, path, {"assignment": "echo-responder"})
    submit(grace, f"{one}/open")
    submit(grace, f"{one}/close")
    assert "Take out of the course" not in grace.get(one).text
    refused = submit(grace, f"{one}/remove")
    assert (refused.status_code, "it can be closed" in words(refused.text)) == (422, True)


def test_an_own_assignment_is_checked_prepared_and_previewed(web: Web, grace: TestClient) -> None:
    folder = assignment_folder("echo-responder")
    files = {
        f"mine/{path.relative_to(folder)}": path.read_text(encoding="utf-8")
        for path in folder.rglob("*")
        if path.is_file() and path.suffix in (".toml", ".py")
    }
    own = {"file": ("mine.zip", zipped(files), "application/zip")}
    answer = submit(grace, f"{HOME}/assignments/uploads", files=own)
    assert answer.status_code == 303, words(answer.text)
    grade_all(web)
    shown = grace.get(answer.headers["location"]).text
    preview = re.search(rf'href="({HOME}/grades/\w+)"', shown)
    assert preview
    assert grace.get(preview[1]).status_code == 200
    with web.store.reading() as session:
        role = select(Enrolment.role).join(SubmissionRow, SubmissionRow.enrolment_id == Enrolment.id)
        assert session.scalars(role).all() == [Role.INSTRUCTOR]
    assert submit(grace, f"{answer.headers['location']}/preview").status_code == 303
    files["mine/assignment.toml"] += '\n[[criterion]]\ntitle = "No check"\nmarks = 1\n'
    own = {"file": ("mine.zip", zipped(files), "application/zip")}
    answer = submit(grace, f"{HOME}/assignments/uploads", files=own)
    assert answer.status_code == 422
    assert "mine/assignment.toml:" in words(answer.text)
    assert grace.get(f"{HOME}/assignments/uploads").headers["location"] == f"{HOME}/assignments"
    answer = submit(grace, f"{HOME}/assignments/uploads", files={"file": ("mine.zip", zipped({"a/b.py": ""}))})
    assert "mine.zip: has no assignment.toml" in words(answer.text)
    example = grace.get(f"{HOME}/assignments/uploads/my-assignment.zip").content
    assert submit(grace, f"{HOME}/assignments/uploads", files={"file": ("my.zip", example)}).status_code == 303


def test_what_students_have_been_shown_is_replaced_by_an_upload_where_that_is_said(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/assignments"
    submit(grace, path, {"assignment": "echo-responder"})
    text = (assignment_folder("echo-responder") / "assignment.toml").read_text(encoding="utf-8")

    def upload(title: str, **fields: str) -> Response:
        changed = re.sub("^title = .*", f'title = "{title}"', text, count=1, flags=re.MULTILINE)
        files = {"file": ("echo.zip", zipped({"echo-responder/assignment.toml": changed}), "application/zip")}
        return submit(grace, f"{path}/uploads", fields, files=files)

    assert 'name="replace"' not in grace.get(path).text
    assert upload("Nobody saw the other").status_code == 303
    submit(grace, f"{path}/echo-responder/open")
    refused = upload("Another")
    assert refused.status_code == 422
    assert "students have been shown another assignment of this id, 'Nobody saw the other'" in words(refused.text)
    assert 'name="replace"' in refused.text
    assert upload("Nobody saw the other").status_code == 303
    assert "Nobody saw the other" in grace.get(path).text
    assert upload("Another", replace="true").status_code == 303
    assert "Another" in grace.get(path).text


def test_the_catalogue_is_looked_through_by_words_and_topic(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/catalogue"

    def found(query: str) -> list[str]:
        return re.findall(r'name="assignment" value="([^"]+)"', grace.get(f"{path}?{query}").text)

    assert sorted(found("")) == sorted(catalogue())
    assert found("q=LOLLIPOP+noise") == ["lollipop-with-noise"]
    assert found("q=sensor&topic=05") == [each for each in found("topic=05") if each in found("q=sensor")]
    assert "relay-a-message" in found("topic=none")
    assert found("q=nothing+is+like+this") == []
    assert "<script" not in words(grace.get(f"{path}?q=%3Cscript%3E&topic=%22").text)
    submit(grace, f"{HOME}/assignments", {"assignment": "lollipop"})
    assert "lollipop" not in found("q=lollipop")
    assert f'href="{HOME}/assignments/lollipop"' in grace.get(f"{path}?q=lollipop").text


def test_students_are_let_in_and_get_more_time(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/people"
    table = {"file": ("class.csv", b"id,name,email\nada,Ada Lovelace,ada@example.org\nbob,Bob,\n")}
    assert submit(grace, f"{path}/table", files=table).status_code == 303
    own = submit(grace, path, {"who": "cid", "name": "Cid"}).headers["location"]
    told = words(grace.get(path).text)
    for each in ("ada Ada Lovelace ada@example.org student", "bob Bob", "cid Cid", "grace Grace instructor"):
        assert each in told
    assert "ada@" not in words(grace.get(f"{path}?q=cid").text)
    submit(grace, f"{own}/extensions", {"due": "2030-01-02", "more_attempts": "2"})
    assert "2 attempts more" in words(grace.get(own).text)
    with web.store.reading() as session:
        done = [entry.action for entry in audit.entries(session, "course", "1")]
    assert done == ["enrol", "enrol", "extend"]
    answer = submit(grace, f"{path}/table", files={"file": ("x.csv", b"\xff\xfe nothing")})
    assert (answer.status_code, "x.csv: " in words(answer.text)) == (422, True)
    assert grace.get(f"{path}/table").headers["location"] == path


def test_letting_in_one_changes_nobody_who_is_there(web: Web, grace: TestClient) -> None:
    path = f"{HOME}/people"
    submit(grace, path, {"who": "ada", "name": "Ada Lovelace"})
    again = submit(grace, path, {"who": "ada", "name": "Somebody Else"})
    assert (again.status_code, "in this course already, as Ada Lovelace" in words(again.text)) == (422, True)
    staff = submit(grace, path, {"who": "grace", "name": "Somebody Else"})
    assert (staff.status_code, "grace is an instructor of this course" in words(staff.text)) == (422, True)
    assert submit(grace, f"{path}/table", files={"file": ("x.csv", b"id,name\ngrace,Nobody")}).status_code == 303
    told = words(grace.get(path).text)
    assert "ada Ada Lovelace" in told
    assert "grace Grace" in told


def test_who_has_submitted_nothing_is_taken_out_of_the_course(web: Web, grace: TestClient) -> None:
    mistyped = submit(grace, f"{HOME}/people", {"who": "zoe"}).headers["location"]
    answer = submit(grace, f"{mistyped}/remove")
    assert "zoe is in the course no more" in words(grace.get(answer.headers["location"]).text)
    assert grace.get(mistyped).status_code == 404
    a_batch(web, "ada")
    with web.store.reading() as session:
        ada = f"{HOME}/people/{people.member(session, COURSE, 'ada').enrolment_id}"
    assert f"{ada}/remove" not in grace.get(ada).text
    assert submit(grace, f"{ada}/remove").status_code == 422
    assert submit(grace, f"{HOME}/people/{web.instructor('linus').enrolment_id}/remove").status_code == 404


def test_no_instructor_makes_a_link_for_another_or_for_who_is_more(web: Web, grace: TestClient) -> None:
    other = web.instructor("linus")
    assert submit(grace, f"{HOME}/people/{other.enrolment_id}/link").status_code == 404
    ada = web.student()
    with web.store.transaction() as session:
        people.make_operator(session, ada.person_id)
    assert submit(grace, f"{HOME}/people/{ada.enrolment_id}/link").status_code == 422
