"""Students' uploads become submissions: their owner, the accepted forms, and the refused ones."""

from __future__ import annotations

import itertools
import random
import zipfile
from collections.abc import Iterator
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from starlette.exceptions import HTTPException

from builders import PROGRAM, echo
from report_builders import faulty_grade
from service.operations.context import Actor
from service.operations.errors import NotFound
from service.operations.submissions import SubmissionRequest
from service.store.batches import intake, stored_requests
from service.store.batches.intake import AcceptedSubmission
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.grades import comments
from service.store.people import credentials
from service.store.people.membership import Member
from service.store.people.students import ensure_course
from service.store.queue import jobs
from service.store.states import CredentialKind, JobQueue, JobState
from service.store.tables.submissions import Job, SubmissionRow
from service.web.access import build_actor
from service.web.student_submissions import submit
from sim.errors import UsageError
from submissions.raw_files import MAX_FILE_BYTES, MAX_FILES, UploadedFile
from web import COURSE, Web, grade_all, web_in, words
from web import submit as submit_form

RESPONDER = "def responder(msg):\n    return msg\n"


_NAMES = (f"student {number}" for number in itertools.count(1))


@pytest.fixture(scope="module")
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    with web_in(tmp_path_factory.mktemp("home")) as opened:
        opened.instructor()
        with opened.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, echo().id)
        yield opened


@pytest.fixture
def ada(web: Web) -> Member:
    """Return a new student without any data."""
    return web.student(next(_NAMES))


def _actor(web: Web, member: Member) -> Actor:
    with web.store.transaction() as session:
        started = credentials.redeem_link(session, web.link(member))
        assert started is not None
        session_owner = credentials.identify(session, started.secret, CredentialKind.SESSION)
    assert session_owner is not None
    return build_actor(session_owner)


def _submit(web: Web, member: Member, *files: tuple[str, bytes | str]) -> AcceptedSubmission:
    sent = [UploadedFile(name, BytesIO(data.encode() if isinstance(data, str) else data)) for name, data in files]
    return submit(web.app.state.context, _actor(web, member), 1, SubmissionRequest(echo().id, sent))


def _zip(*entries: tuple[str, str]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in entries:
            archive.writestr(name, text)
    return buffer.getvalue()


BOTH = (("robot.py", PROGRAM), ("responder.py", RESPONDER))


@pytest.mark.parametrize(
    "files",
    [
        BOTH,
        (("work.zip", _zip(*BOTH)),),
        (("work.zip", _zip(*((f"top/{name}", text) for name, text in BOTH))),),
        (("C:\\work\\robot.py", PROGRAM), ("../../etc/responder.py", RESPONDER)),
    ],
)
def test_files_and_archives_are_one_submission_each(
    web: Web, ada: Member, files: tuple[tuple[str, bytes | str], ...]
) -> None:
    accepted = _submit(web, ada, *files)
    with web.store.reading() as session:
        job = session.get_one(Job, accepted.job_id)
        submission = stored_requests.load_submission(session, accepted.job_id)
        assert (job.lane, job.submission_id) == (JobQueue.INTERACTIVE, accepted.submission_id)
    assert [part and part.text for part in (submission.program, submission.responder)] == [PROGRAM, RESPONDER]
    assert not submission.files


def test_a_submission_is_whose_session_it_is_whatever_its_files_say(web: Web, ada: Member) -> None:
    bob = web.student(next(_NAMES))
    accepted = _submit(web, ada, ("bob.zip", _zip(*BOTH, ("submission.toml", f'student = "{bob.id}"\n'))))
    with web.store.reading() as session:
        assert session.get_one(SubmissionRow, accepted.submission_id).enrolment_id == ada.enrolment_id


@pytest.mark.parametrize(
    ("files", "sentence"),
    [
        ((), "no files were submitted"),
        ((("notes.txt", "x"),), "notes.txt: has no robot.py"),
        ((*BOTH, ("a/robot.py", PROGRAM)), "has robot.py twice"),
        ((("robot.py", b"\0"),), "has a NUL character"),
        ((("robot.py", " \n\t\n"), BOTH[1]), "robot.py is empty"),
        ((BOTH[0], ("responder.py", "")), "responder.py is empty"),
        ((BOTH[0],), "there is no responder.py"),
        ((("work.zip", b"PK\x03\x04 no archive"),), "is not a zip archive"),
        ((("work.zip", _zip(("../robot.py", PROGRAM))),), "leads outside"),
        ((("robot\r\nset-cookie: x.py", PROGRAM),), "has a file name that cannot be used"),
        ((("", PROGRAM),), "has a file name that cannot be used"),
        ((("work.zip", _zip(("robot.py", "#" * (MAX_FILE_BYTES + 1)))),), "is too large"),
        (tuple((f"{number}.txt", "") for number in range(MAX_FILES + 1)), "has too many files"),
    ],
)
def test_what_is_no_submission_is_refused_with_a_sentence(
    web: Web, ada: Member, files: tuple[tuple[str, bytes | str], ...], sentence: str
) -> None:
    with pytest.raises(UsageError, match=sentence):
        _submit(web, ada, *files)
    with web.store.reading() as session:
        assert not session.scalars(select(SubmissionRow).where(SubmissionRow.enrolment_id == ada.enrolment_id)).all()


def test_only_what_is_open_takes_submissions(web: Web, ada: Member) -> None:
    with web.store.transaction() as session:
        open_assignments.close_assignment(session, 1, echo().id)
    with pytest.raises(UsageError, match="is closed"):
        _submit(web, ada, *BOTH)
    with web.store.transaction() as session:
        open_assignments.open_for_students(session, 1, echo().id)
    with pytest.raises(NotFound):
        submit(web.app.state.context, _actor(web, ada), 1, SubmissionRequest("no-such", []))


def test_an_assignment_that_closes_before_the_submission_is_stored_takes_none(
    web: Web, ada: Member, monkeypatch: pytest.MonkeyPatch
) -> None:
    accept = intake.accept_submission

    def close_then_accept(*arguments: Any, **options: Any) -> AcceptedSubmission:
        with web.store.transaction() as session:
            open_assignments.close_assignment(session, 1, echo().id)
        return accept(*arguments, **options)

    monkeypatch.setattr(intake, "accept_submission", close_then_accept)
    with pytest.raises(UsageError, match="is closed"):
        _submit(web, ada, *BOTH)
    with web.store.transaction() as session:
        assert not session.scalars(select(SubmissionRow).where(SubmissionRow.enrolment_id == ada.enrolment_id)).all()
        open_assignments.open_for_students(session, 1, echo().id)


def test_only_a_few_submissions_are_read_at_a_time(web: Web, ada: Member, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.web.context._SLOT_SECONDS", 0.1)
    reading = web.app.state.context.reading
    taken = 0
    while reading.acquire(blocking=False):
        taken += 1
    assert taken == 3
    with pytest.raises(HTTPException) as caught:
        _submit(web, ada, ("robot.py", PROGRAM), ("responder.py", "x = 1\n"))
    assert caught.value.status_code == 503
    reading.release(taken)
    _submit(web, ada, ("robot.py", PROGRAM), ("responder.py", "x = 1\n"))
    assert reading.acquire(blocking=False)
    reading.release()


def test_nobody_submits_without_end(web: Web, ada: Member) -> None:
    for _ in range(10):
        with pytest.raises(UsageError):
            _submit(web, ada)
    with pytest.raises(HTTPException) as refused:
        _submit(web, ada, *BOTH)
    assert refused.value.status_code == 429


def _rows(web: Web, member: Member) -> list[tuple[int, bool, JobState]]:
    """Return attempt, over-limit flag and state of all jobs of a student."""
    query = (
        select(SubmissionRow.attempt, SubmissionRow.staff_only, Job.state)
        .join(Job, Job.submission_id == SubmissionRow.id)
        .where(SubmissionRow.enrolment_id == member.enrolment_id)
        .order_by(SubmissionRow.attempt)
    )
    with web.store.reading() as session:
        return [(attempt, over is not None, state) for attempt, over, state in session.execute(query)]


@pytest.fixture
def once(tmp_path: Path) -> Iterator[Web]:
    """Yield a course that allows one attempt and a few bytes."""
    with web_in(tmp_path, student_quota_mb=1) as opened:
        with opened.store.transaction() as session:
            ensure_course(session, COURSE, datetime.now(UTC))
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, echo().id)
            policies.set_policy(session, 1, "", PolicyLimits(attempts=1))
        yield opened


def _send(web: Web, member: Member, number: int) -> AcceptedSubmission:
    return _submit(web, member, ("robot.py", PROGRAM + f"# {number}\n"), ("responder.py", RESPONDER))


def test_over_a_limit_the_newest_is_kept_and_graded_when_staff_ask(once: Web) -> None:
    ada, grace = once.student(), once.instructor()
    _send(once, ada, 0)
    grade_all(once, faulty_grade())
    made = [_send(once, ada, number) for number in range(1, 6)]
    assert _rows(once, ada) == [(1, False, JobState.DONE), (6, True, JobState.CANCELLED)]
    assert jobs.claim_job(once.store, "worker", 60) is None
    path = f"/courses/1/grades/{made[-1].job_id}"
    page_text = words(once.browser(ada).get(f"/courses/1/mine/submissions/{made[-1].submission_id}").text)
    assert "no attempts left" in page_text
    browser = once.browser(grace)
    assert "Grade this submission" in browser.get(path).text
    assert submit_form(browser, f"{path}/grade-over-limit").status_code == 303
    assert "Grade this submission" not in browser.get(path).text
    assert submit_form(browser, f"{path}/grade-over-limit").status_code == 409
    grade_all(once, faulty_grade())
    assert _rows(once, ada)[-1] == (6, True, JobState.DONE)
    # A job that staff requested stays. The following one is over the limit again.
    last = _send(once, ada, 7)
    assert [state for _, _, state in _rows(once, ada)] == [JobState.DONE, JobState.DONE, JobState.CANCELLED]
    token = once.token(grace, "mark")
    response = once.browser().post(f"/api/v1/courses/1/grades/{last.job_id}/over-limit", headers=token)
    assert response.status_code == 204
    assert (
        once.browser()
        .post(f"/api/v1/courses/1/grades/{last.job_id}/over-limit", headers=once.token(ada, "mark"))
        .status_code
        == 404
    )


@pytest.mark.long
def test_a_submission_over_a_limit_that_has_a_comment_is_kept(once: Web) -> None:
    ada = once.student()
    _send(once, ada, 0)
    grade_all(once, faulty_grade())
    made = _send(once, ada, 1)
    with once.store.transaction() as session:
        comments.add_comment(session, made.job_id, "", "This is over the limit.", "grace")
    for number in (2, 3):
        _send(once, ada, number)
    assert [attempt for attempt, _, _ in _rows(once, ada)] == [1, 2, 4]


def test_a_student_fills_no_more_than_the_quota(once: Web) -> None:
    ada, bob = once.student(), once.student("bob")
    noise = random.Random(1).randbytes(400_000)
    for number in range(2):
        files = (("robot.py", PROGRAM), ("responder.py", RESPONDER), ("model.bin", noise + bytes([number])))
        _submit(once, ada, *files)
        grade_all(once, faulty_grade())
    # One submission over the limit is kept. The next one replaces it and needs no additional space.
    _submit(once, ada, ("robot.py", PROGRAM), ("responder.py", RESPONDER), ("model.bin", noise + b"x"))
    with pytest.raises(UsageError, match="limit is 1 MB in total"):
        _submit(once, ada, ("robot.py", PROGRAM), ("responder.py", RESPONDER), ("model.bin", noise * 2))
    assert sum(size for size in _sizes(once, ada)) <= 2**20
    _submit(once, bob, ("robot.py", PROGRAM), ("responder.py", RESPONDER), ("model.bin", noise))


def _sizes(web: Web, member: Member) -> list[int]:
    with web.store.reading() as session:
        own = SubmissionRow.enrolment_id == member.enrolment_id
        return list(session.scalars(select(SubmissionRow.size).where(own)))
