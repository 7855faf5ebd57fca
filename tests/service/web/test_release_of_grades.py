"""When students see a grade: at once, when it is published, or from a date; and what they read of a changed one."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from io import BytesIO

import pytest

import acting
import report_builders
from builders import PROGRAM, echo, grading_request, prepared
from rows import quick_first
from service.operations import own_submissions
from service.store.batches import intake
from service.store.courses import open_assignments, policies
from service.store.courses.assignment_versions import freeze_assignment
from service.store.courses.policies import PolicyLimits
from service.store.engine import Store
from service.store.grades.appeals import can_appeal
from service.store.people.membership import Member
from service.store.queue import jobs
from service.store.states import CountedAttempt, ReleaseRule
from service.store.tables.courses import Course
from service.store.tables.submissions import Job
from service.student_export import export_student
from student_reader import StudentReader
from submissions.student_identity import RejectedSubmission, Student
from web import COURSE, Web, grade_all, submit, web_in, words

ASSIGNMENT = "echo-responder"
MINE = "/courses/1/mine"
#: What only the grade says.
SECRET = "No answer arrived."
_PAST, _FUTURE = -timedelta(hours=1), timedelta(hours=1)


@pytest.fixture
def web(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Web]:
    with web_in(tmp_path_factory.mktemp("home")) as made:
        made.instructor()
        with made.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, ASSIGNMENT)
        yield made


@pytest.fixture
def ada(web: Web) -> Member:
    return web.student("ada")


def _set(web: Web, limits: PolicyLimits, assignment: str = ASSIGNMENT) -> None:
    with web.store.transaction() as session:
        policies.set_policy(session, 1, assignment, limits)


def _submit_herself(web: Web, ada: Member, program: str = PROGRAM, marks: int = 0) -> None:
    files = {"texts": [program, "def responder(msg):\n    return msg\n"]}
    assert submit(web.browser(ada), f"{MINE}/{ASSIGNMENT}", files).status_code == 303
    _grade(web, marks)


def _upload_for_her(web: Web, program: str = PROGRAM, marks: int = 0) -> str:
    """Return the id of the batch."""
    request = grading_request("ada", program)
    accepted = intake.accept_new_submissions(web.store, "week one", [request], (), course=COURSE, max_attempts=1)
    _grade(web, marks)
    assert accepted.batch is not None
    return accepted.batch.id


def _grade(web: Web, marks: int) -> None:
    grade = report_builders.faulty_grade()
    criteria = tuple(replace(each, marks=Decimal(marks)) for each in grade.criteria)
    grade_all(web, replace(grade, criteria=criteria))


def _read_secrets(web: Web, ada: Member) -> list[str]:
    """Return where Ada reads something of her grade: pages, API, export, and whether she may appeal."""
    values = {"submission_id": "1", "assignment": ASSIGNMENT}
    answers = StudentReader(web, ada, values).everything()
    found = [path for path, answer in answers.items() if SECRET in str(answer) or "of 4 marks" in str(answer)]
    with web.store.reading() as session:
        found += ["appeal"] if can_appeal(session, 1) else []
    if any(SECRET.encode() in content for content in _export(web, ada)):
        found.append("export")
    return found


def _export(web: Web, ada: Member) -> list[bytes]:
    with zipfile.ZipFile(BytesIO(export_student(web.store, ada.enrolment_id))) as archive:
        return [archive.read(name) for name in archive.namelist()]


#: The rule (None: no policy), the time from now at which all grades are released, whether Ada submitted herself, and
#: whether she sees the grade.
_CASES: list[tuple[ReleaseRule | None, timedelta | None, bool, bool]] = [
    (None, None, True, True),
    (None, None, False, False),
    (ReleaseRule.AT_ONCE, None, False, True),
    (ReleaseRule.PUBLISHED, _FUTURE, True, False),
    (ReleaseRule.OWN_AT_ONCE, None, True, True),
    (ReleaseRule.OWN_AT_ONCE, None, False, False),
    (ReleaseRule.OWN_AT_ONCE, _PAST, False, True),
    (ReleaseRule.PUBLISHED, None, True, False),
    (ReleaseRule.PUBLISHED, _PAST, True, True),
]


@pytest.mark.long
@pytest.mark.parametrize("case", quick_first(_CASES, quick=4))
def test_a_grade_is_seen_when_the_policy_releases_it(
    web: Web, ada: Member, case: tuple[ReleaseRule | None, timedelta | None, bool, bool]
) -> None:
    rule, from_now, is_own, is_seen = case
    if rule is not None:
        released_at = None if from_now is None else datetime.now(UTC) + from_now
        _set(web, PolicyLimits(release=rule, released_at=released_at))
    if is_own:
        _submit_herself(web, ada)
    else:
        _upload_for_her(web)
    secrets = _read_secrets(web, ada)
    assert bool(secrets) == is_seen
    if is_seen:
        assert {"appeal", "export"} < set(secrets)
    else:
        assert "you see the marks when staff release them" in words(web.browser(ada).get(MINE).text)


def test_publication_releases_the_grades_of_the_batch(web: Web, ada: Member) -> None:
    batch_id = _upload_for_her(web)
    assert _read_secrets(web, ada) == []
    acting.publish(web.store, batch_id, actor="grace")
    assert {"appeal", "export"} < set(_read_secrets(web, ada))


@pytest.mark.long
def test_the_policy_of_the_assignment_replaces_the_default_completely(web: Web, ada: Member) -> None:
    _set(web, PolicyLimits(release=ReleaseRule.AT_ONCE, released_at=datetime.now(UTC) + _PAST), assignment="")
    _upload_for_her(web)
    assert _read_secrets(web, ada)
    _set(web, PolicyLimits(attempts=3))
    assert _read_secrets(web, ada) == []


@pytest.mark.long
@pytest.mark.parametrize("first", [ReleaseRule.AT_ONCE, ReleaseRule.PUBLISHED])
def test_each_course_has_its_own_policy(store: Store, first: ReleaseRule) -> None:
    second = ReleaseRule.PUBLISHED if first is ReleaseRule.AT_ONCE else ReleaseRule.AT_ONCE
    for course, who in (("one", "ada"), ("two", "bob"), ("one", "cid")):
        intake.accept_batch(store, "week one", [grading_request(who)], (), course=course, max_attempts=1)
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        jobs.finish_job(store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    with store.transaction() as session:
        for course_id, rule in ((1, first), (2, second)):
            policies.set_policy(session, course_id, "", PolicyLimits(release=rule))
    with store.reading() as session:
        seen = [can_appeal(session, submission_id) for submission_id in (1, 2, 3)]
        shown = [
            own_submissions.load_own_attempts(session, enrolment_id, ASSIGNMENT).newest[0].shown
            for enrolment_id in (1, 2, 3)
        ]
    assert seen == shown == [rule is ReleaseRule.AT_ONCE for rule in (first, second, first)]


@pytest.mark.long
@pytest.mark.parametrize("unseen_marks", [0, 4])
def test_whether_an_unseen_attempt_is_the_best_is_not_told(web: Web, ada: Member, unseen_marks: int) -> None:
    with web.store.transaction() as session:
        session.get_one(Course, 1).counted_attempt = CountedAttempt.BEST
    _submit_herself(web, ada, marks=2)
    assert "current grade" in words(web.browser(ada).get(f"{MINE}/{ASSIGNMENT}").text)
    _upload_for_her(web, "print('PY::again')\n", marks=unseen_marks)
    for page in (MINE, f"{MINE}/{ASSIGNMENT}"):
        assert "current grade" not in words(web.browser(ada).get(page).text).lower()


def test_the_form_and_the_api_set_the_release(web: Web) -> None:
    browser = web.browser(web.instructor())
    chosen = {"assignment": ASSIGNMENT, "release": "published", "released": "2026-12-14T09:00"}
    assert submit(browser, "/courses/1/policy", chosen).status_code == 303
    page_text = browser.get(f"/courses/1/assignments/{ASSIGNMENT}").text
    assert 'value="published" selected' in page_text
    assert 'value="2026-12-14T09:00"' in page_text
    token = web.token(web.instructor(), "read", "manage")
    listed = web.browser().get("/api/v1/courses/1/policies", headers=token).json()["items"]
    assert [each["release"] for each in listed] == ["published"]
    assert datetime.fromisoformat(listed[0]["released_at"]) == datetime(2026, 12, 14, 9).astimezone()


@pytest.mark.long
@pytest.mark.parametrize(
    ("changed", "reason"),
    [("assignment_version_id", "The assignment was corrected."), ("grader_sha256", "A newer release of the grader")],
)
def test_a_changed_published_mark_is_told_with_the_earlier_one(
    web: Web, ada: Member, changed: str, reason: str
) -> None:
    batch_id = _upload_for_her(web, marks=3)
    acting.publish(web.store, batch_id, actor="grace")
    _regrade(web, batch_id, changed, marks=1)
    assert "Your marks changed" not in _read_pages(web, ada)
    acting.publish(web.store, batch_id, actor="grace")
    pages = _read_pages(web, ada)
    assert pages.count("Your marks changed from 3 of 4 to 1 of 4 on ") == 4  # twice on the page of the submission
    assert reason in pages
    token = web.token(ada, "read")
    change = web.browser().get("/api/v1/courses/1/mine/submissions/1", headers=token).json()["change"]
    assert (change["marks"], change["max_marks"]) == (3, 4)


def test_equal_marks_are_no_change(web: Web, ada: Member) -> None:
    batch_id = _upload_for_her(web, marks=3)
    acting.publish(web.store, batch_id, actor="grace")
    _regrade(web, batch_id, "grader_sha256", marks=3)
    acting.publish(web.store, batch_id, actor="grace")
    assert "Your marks changed" not in _read_pages(web, ada)


def _read_pages(web: Web, ada: Member) -> str:
    browser = web.browser(ada)
    return " ".join(words(browser.get(f"{MINE}{page}").text) for page in ("", f"/{ASSIGNMENT}", "/submissions/1"))


def _regrade(web: Web, batch_id: str, changed: str, marks: int) -> None:
    acting.regrade(web.store, batch_id)
    _grade(web, marks)
    with web.store.transaction() as session:
        newest = session.query(Job).order_by(Job.queued_at.desc()).first()
        assert newest is not None
        if changed == "assignment_version_id":
            other = replace(echo(), title="Echo, corrected")
            newest.assignment_version_id = open_assignments.prepare_assignment(
                session, 1, freeze_assignment(other)
            ).version_id
        else:
            newest.grader_sha256 = "0" * 64


def test_a_closed_assignment_says_when_it_was_closed(web: Web, ada: Member) -> None:
    with web.store.transaction() as session:
        open_assignments.close_assignment(session, 1, ASSIGNMENT)
    browser = web.browser(ada)
    assert f"Closed on {datetime.now(UTC).astimezone():%Y-%m-%d}" in words(browser.get(MINE).text)
    for page in (f"{MINE}/{ASSIGNMENT}", f"{MINE}/{ASSIGNMENT}/try"):
        page_text = words(browser.get(page).text)
        assert f"This assignment was closed on {datetime.now(UTC).astimezone():%Y-%m-%d}" in page_text
        assert "<textarea" not in browser.get(page).text


def test_a_file_rejected_in_a_batch_is_told_to_its_student_until_they_submit(web: Web, ada: Member) -> None:
    rejected = RejectedSubmission("ada.docx", "names bob and holds no program", Student("ada"), ASSIGNMENT)
    intake.accept_batch(web.store, "week one", [grading_request("bob")], [rejected], course=COURSE, max_attempts=1)
    listed = words(web.browser(ada).get(MINE).text)
    assert f"ada.docx · {ASSIGNMENT}" in listed
    assert "bob" not in listed
    assert "ada.docx" not in words(web.browser(web.student("bob")).get(MINE).text)
    _submit_herself(web, ada)
    assert "ada.docx" not in words(web.browser(ada).get(MINE).text)


def test_a_student_is_told_before_they_submit_that_a_worse_or_late_attempt_counts(web: Web, ada: Member) -> None:
    page = f"{MINE}/{ASSIGNMENT}"
    _submit_herself(web, ada, marks=3)
    for shown in (page, f"{page}/try"):
        assert "Your current grade is from attempt 1: 3 of 4 marks." in words(web.browser(ada).get(shown).text)
    _set(web, PolicyLimits(datetime.now(UTC) + _PAST, late_days=2))
    assert "A new submission is late." in words(web.browser(ada).get(page).text)


def test_staff_see_beforehand_what_the_student_will_see(web: Web, ada: Member) -> None:
    grade = report_builders.faulty_grade()
    (first, *_) = grade.criteria
    later = replace(first, id="later", title="Opens with publication", visibility="after_published")
    hidden = replace(first, id="hidden", title="Never opens", visibility="hidden")
    request = grading_request("ada")
    accepted = intake.accept_new_submissions(web.store, "week one", [request], (), course=COURSE, max_attempts=1)
    grade_all(web, replace(grade, criteria=(first, later, hidden)))
    assert accepted.batch is not None
    grace, path = web.browser(web.instructor()), f"/courses/1/grades/{accepted.batch.jobs[0].job_id}"
    beforehand = words(grace.get(f"{path}/as-student").text)
    assert "The student sees this report when you publish the grade." in beforehand
    assert ("Opens with publication" in beforehand, "Never opens" in beforehand) == (True, False)
    acting.publish(web.store, accepted.batch.id, actor="grace")
    seen = words(web.browser(ada).get(f"{MINE}/submissions/1").text)
    assert ("Opens with publication" in seen, "Never opens" in seen) == (True, False)
    assert "The student sees this report." in words(grace.get(f"{path}/as-student").text)
    assert web.browser(ada).get(f"{path}/as-student").status_code == 404
