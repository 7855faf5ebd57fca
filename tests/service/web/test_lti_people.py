"""Launches never replace others: an enrolment keeps its person, a context its deployment, a service its address."""

from __future__ import annotations

import random
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import select, update
from sqlalchemy.orm import Session

from builders import grading_request, opened, settings_in
from service.lti import services
from service.lti.platform_requests import PlatformError, PlatformReply
from service.lti.services import Score
from service.store.batches import intake
from service.store.engine import Store, now
from service.store.people import credentials, lti, membership
from service.store.people.lti import CourseLink, LaunchResult, Platform, Registration
from service.store.people.reach import UNLIMITED_REACH, Reach
from service.store.people.students import Students
from service.store.states import CredentialKind, Role
from service.store.tables.courses import Course
from service.store.tables.people import Credential, Enrolment, LtiCourse, LtiPerson, Person
from sim.errors import UsageError
from submissions.student_identity import Student

INSTRUCTOR, STUDENT = Role.INSTRUCTOR, Role.STUDENT
SCORE = Score("ada", Decimal(1), Decimal(1), datetime(2030, 1, 1, tzinfo=UTC))
URLS = ("https://platform.example.org/auth", "https://platform.example.org/token", "https://keys.example.org/keys")


@pytest.fixture
def platform(store: Store) -> Platform:
    return register(store)


def register(store: Store, *origins: str, name: str = "Moodle") -> Platform:
    with store.transaction() as session:
        lti.register_platform(
            session, Registration(name, f"https://{name}.example.org", "c", ("1", "2"), *URLS, origins)
        )
        return next(each for each in lti.list_platforms(session) if each.name == name)


def launch(
    store: Store,
    platform: Platform,
    subject: str,
    role: Role = STUDENT,
    *,
    context: str = "c1",
    deployment: str = "1",
    id: str = "",
    members_url: str | None = None,
    title: str = "Robotics",
) -> LaunchResult | None:
    """Return a launch with a valid session, as the web server creates it."""
    with store.transaction() as session:
        who = Student(id or subject, subject.capitalize())
        launched = lti.resolve_launch(
            session, platform, deployment, context, title, subject, who, role, members_url, members_url
        )
        if launched is not None:
            sign_in(session, launched.person_id, Reach(platform_id=platform.id))
        return launched


def sign_in(session: Session, person_id: int, reach: Reach = UNLIMITED_REACH) -> None:
    """Create a session of this person."""
    credentials.issue_credential(session, person_id, CredentialKind.SESSION, credentials.SESSION_LIFETIME, reach=reach)


def test_a_person_known_from_one_course_takes_nobodys_place_in_another(store: Store, platform: Platform) -> None:
    for context in ("c1", "c2"):
        launch(store, platform, "grace", INSTRUCTOR, context=context)
    victim = launch(store, platform, "victim", context="c2")
    launch(store, platform, "mallory", context="c1")
    for id in ("victim", "grace"):
        with pytest.raises(UsageError, match="another person already has the ID"):
            launch(store, platform, "mallory", context="c2", id=id)
    with store.reading() as session:
        assert victim is not None
        members = {each.id: (each.person_id, each.role) for each in membership.list_members(session, victim.course_id)}
        assert members["victim"] == (victim.person_id, STUDENT)
        assert members["grace"][1] is INSTRUCTOR
    # An unused id becomes theirs.
    other = launch(store, platform, "mallory", context="c2", id="mallory")
    first = launch(store, platform, "mallory", context="c1")
    assert other is not None
    assert first is not None
    assert other.person_id == first.person_id


def test_a_batch_that_came_first_waits_for_its_students(store: Store, platform: Platform) -> None:
    """Nobody has signed in as a student that only a batch names, so the platform decides whose id it is."""
    for context in ("c1", "c2"):
        launch(store, platform, "grace", INSTRUCTOR, context=context)
    known = launch(store, platform, "ada", context="c1")
    with store.reading() as session:
        course = session.get_one(Course, 2).name
    intake.accept_submission(store, grading_request("ada"), course=course, max_attempts=1)
    with store.transaction() as session:
        row = session.scalars(select(Enrolment).where(Enrolment.course_id == 2, Enrolment.student == "ada")).one()
        (link,) = credentials.replace_links(session, [row.person_id], credentials.LINK_LIFETIME).values()
        nobody = row.person_id
    claimed = launch(store, platform, "ada", context="c2")
    assert claimed is not None
    assert known is not None
    assert claimed.person_id == known.person_id
    with store.transaction() as session:
        assert session.get(Person, nobody) is None
        assert credentials.redeem_link(session, link) is None


@pytest.mark.parametrize("who", ["signed in", "instructs", "elsewhere", "operator", "other platform"])
def test_who_has_a_place_keeps_it(store: Store, platform: Platform, who: str) -> None:
    launch(store, platform, "grace", INSTRUCTOR)
    with store.transaction() as session:
        row = session.get_one(Enrolment, Students(session, 1).enrol(Student("ada"), now(session)))
        if who == "signed in":
            sign_in(session, row.person_id)
            # Years later, no data of the session remains.
            session.execute(update(Credential).values(revoked_at=now(session)))
        elif who == "instructs":
            row.role = INSTRUCTOR
        elif who == "operator":
            membership.make_operator(session, row.person_id)
        elif who == "elsewhere":
            other = membership.make_student(session, "another", Student("ada"))
            session.get_one(Enrolment, other.enrolment_id).person_id = row.person_id
        person_id, role = row.person_id, row.role
    if who == "other platform":
        other_platform = register(store, name="Canvas")
        with store.transaction() as session:
            session.add(LtiPerson(platform_id=other_platform.id, subject="ada", person_id=person_id))
    with pytest.raises(UsageError, match="another person already has the ID 'ada'"):
        launch(store, platform, "new", id="ada")
    with store.reading() as session:
        row = session.scalars(select(Enrolment).where(Enrolment.course_id == 1, Enrolment.student == "ada")).one()
        assert (row.person_id, row.role) == (person_id, role)


def test_an_instructor_on_a_platform_is_no_instructor_of_a_later_course(store: Store, platform: Platform) -> None:
    mallory = launch(store, platform, "mallory", INSTRUCTOR, id="dean")
    with store.transaction() as session:
        dean = membership.make_instructor(session, "Exam", Student("dean"))
    assert mallory is not None
    assert dean.person_id != mallory.person_id
    with store.reading() as session:
        assert [course for course, _ in membership.load_enrolments(session, mallory.person_id)] == ["Robotics"]


def test_a_platform_makes_no_course_that_is_the_installations_own(store: Store, platform: Platform) -> None:
    launch(store, platform, "root", INSTRUCTOR, title="default")
    with store.reading() as session:
        assert [each.name for each in membership.list_courses(session)] == ["default (2)"]


def test_launches_at_once_make_one_course_and_one_person(store: Store, platform: Platform) -> None:
    with ThreadPoolExecutor(4) as pool:
        launches = set(pool.map(lambda _: launch(store, platform, "grace", INSTRUCTOR), range(8)))
    assert len(launches) == 1
    with store.reading() as session:
        assert len(membership.list_members(session, 1)) == 1


def test_two_deployments_share_no_course(store: Store, platform: Platform) -> None:
    first = launch(store, platform, "grace", INSTRUCTOR, deployment="1")
    second = launch(store, platform, "linus", INSTRUCTOR, deployment="2")
    assert first is not None
    assert second is not None
    assert first.course_id != second.course_id
    assert launch(store, platform, "linus", INSTRUCTOR, deployment="2") == second


def test_a_course_without_a_recorded_deployment_is_of_its_own_instructors(store: Store, platform: Platform) -> None:
    first = launch(store, platform, "grace", INSTRUCTOR, deployment="1")
    with store.transaction() as session:
        session.execute(update(LtiCourse).values(deployment=""))
    assert launch(store, platform, "ada", deployment="1") is None
    other = launch(store, platform, "linus", INSTRUCTOR, deployment="2")
    assert other is not None
    assert first is not None
    assert other.course_id != first.course_id
    assert launch(store, platform, "grace", INSTRUCTOR, deployment="1") == first
    ada = launch(store, platform, "ada", deployment="1")
    assert ada is not None
    assert ada.course_id == first.course_id


@pytest.mark.parametrize("kind", ["subject", "context", "deployment"])
def test_long_ids_are_refused_and_never_cut(store: Store, platform: Platform, kind: str) -> None:
    names = {"subject": "grace", "context": "c1", "deployment": "1", "id": "grace"}
    assert launch(store, platform, role=INSTRUCTOR, **{**names, kind: "x" * 250})
    for end in "ab":
        with pytest.raises(UsageError, match=f"{kind} ID is longer than 250 characters"):
            launch(store, platform, role=INSTRUCTOR, **{**names, kind: "x" * 250 + end})
    with pytest.raises(UsageError, match="deployment ID is longer"), store.transaction() as session:
        lti.register_platform(session, Registration("n", "i", "c", ("x" * 251,), *URLS))


@pytest.mark.parametrize("which", [0, 1])
def test_an_issuer_and_a_client_fit_into_an_index(store: Store, which: int) -> None:
    chance = random.Random(0)
    longest = ["".join(chr(chance.randrange(0x10400, 0x1F9FF)) for _ in range(255)) for _ in range(2)]
    longer = [each + "x" * (number == which) for number, each in enumerate(longest)]
    with store.transaction() as session:
        lti.register_platform(session, Registration("n", longest[0], longest[1], ("1",), *URLS))
    with pytest.raises(UsageError, match="longer than 255 characters"), store.transaction() as session:
        lti.register_platform(session, Registration("n", longer[0], longer[1], ("1",), *URLS))


@pytest.mark.parametrize("which", range(3))
@pytest.mark.parametrize("address", ["https://", "http:///auth", "https://me@platform.example.org/", "ftp://a:21/"])
def test_every_address_of_a_platform_has_an_origin(store: Store, which: int, address: str) -> None:
    first, second, third = (address if number == which else url for number, url in enumerate(URLS))
    with pytest.raises(UsageError, match="address is"), store.transaction() as session:
        lti.register_platform(session, Registration("n", "i", "c", ("1",), first, second, third))


def test_long_ids_of_people_stay_apart(store: Store, platform: Platform) -> None:
    launches = [launch(store, platform, end, INSTRUCTOR, id="x" * 300 + end) for end in "ab"]
    assert len({each.person_id for each in launches if each is not None}) == 2
    with pytest.raises(UsageError, match="longer than 500"):
        launch(store, platform, "c", id="x" * 501)


def test_only_instructors_say_where_services_are(store: Store, platform: Platform) -> None:
    launch(store, platform, "grace", INSTRUCTOR, members_url="https://platform.example.org/a")
    launch(store, platform, "ada", members_url="https://platform.example.org/b")
    with store.reading() as session:
        link = lti.find_course_link(session, 1)
    assert link is not None
    assert (link.members_url, link.lineitems_url) == ("https://platform.example.org/a",) * 2


@pytest.mark.parametrize(
    ("url", "allowed"),
    [
        ("https://platform.example.org/members", True),
        ("https://platform.example.org:443/members", True),
        ("https://KEYS.example.org/members", True),
        ("https://services.example.org/members?a=b", True),
        ("http://platform.example.org/members", False),
        ("https://platform.example.org:8443/members", False),
        ("https://platform.example.org.evil.org/members", False),
        ("https://platform.example.org@127.0.0.1/members", False),
        ("http://127.0.0.1:9/latest/meta-data", False),
        ("http://[::1]:9/", False),
        ("file:///etc/passwd", False),
        ("//platform.example.org/members", False),
        ("/members", False),
        ("https://platform.example.org:x/", False),
        ("", False),
    ],
)
def test_services_are_only_asked_where_an_operator_registered_them(
    store: Store, monkeypatch: pytest.MonkeyPatch, url: str, allowed: bool
) -> None:
    platform = register(store, "https://services.example.org")
    requested_urls: list[str] = []

    def fetched(url: str, **_: object) -> PlatformReply:
        requested_urls.append(url)
        return PlatformReply({"access_token": "t", "members": [], "id": url}, "")

    monkeypatch.setattr(services, "fetch_json", fetched)
    link = CourseLink(platform, url, url)
    if allowed:
        assert services.fetch_members(store, link) == []
        services.send_scores(store, link, "a", "A", [SCORE])
        return
    for ask in (
        lambda: services.fetch_members(store, link),
        lambda: services.send_scores(store, link, "a", "A", [SCORE]),
    ):
        with pytest.raises(PlatformError, match="not registered"):
            ask()
    # Not even a token was requested.
    assert requested_urls == []


@pytest.mark.parametrize("where", ["next page", "column"])
def test_what_a_platform_names_itself_is_only_asked_where_it_is_registered(
    store: Store, platform: Platform, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    inside = "http://127.0.0.1:9/inside"
    requested_urls: list[str] = []

    def fetched(url: str, *, method: str = "GET", **_: object) -> PlatformReply:
        requested_urls.append(url)
        if url.endswith("/token"):
            return PlatformReply({"access_token": "t"}, "")
        if where == "next page":
            return PlatformReply({"members": []}, f'<{inside}>; rel="next"')
        return PlatformReply({"id": inside} if method == "POST" else [], "")

    monkeypatch.setattr(services, "fetch_json", fetched)
    url = "https://platform.example.org/service"
    link = CourseLink(platform, url, url)
    ask: dict[str, Callable[[], object]] = {
        "next page": lambda: services.fetch_members(store, link),
        "column": lambda: services.send_scores(store, link, "a", "A", [SCORE]),
    }
    with pytest.raises(PlatformError, match=r"uses http://127\.0\.0\.1:9 for a service"):
        ask[where]()
    assert not [each for each in requested_urls if "127.0.0.1" in each]


_LAUNCHES = st.lists(
    st.tuples(
        st.sampled_from("abcd"),  # the subject
        st.sampled_from(["a", "b", "c", "d", "local", "A "]),  # the id that the platform sends
        st.sampled_from(["c1", "c2"]),
        st.sampled_from([INSTRUCTOR, STUDENT]),
    ),
    min_size=1,
    max_size=12,
)


@pytest.mark.long
@settings(max_examples=40)
@given(launches=_LAUNCHES)
def test_no_launch_changes_the_person_or_the_role_of_a_row_that_another_has(
    launches: list[tuple[str, str, str, Role]],
) -> None:
    with TemporaryDirectory() as folder, opened(settings_in(Path(folder))) as store:
        platform = register(store)
        for context in ("c1", "c2"):
            launch(store, platform, "owner", INSTRUCTOR, context=context)
        with store.transaction() as session:
            row = session.get_one(Enrolment, Students(session, 2).enrol(Student("local"), now(session)))
            sign_in(session, row.person_id)
        for subject, id, context, role in launches:
            before = _rows(store)
            try:
                launched = launch(store, platform, subject, role, context=context, id=id)
            except UsageError:
                launched = None
            after = _rows(store)
            own = None if launched is None else launched.person_id
            assert {row for row in before if row[1] != own} <= after, (subject, id, context)
        by_person: dict[tuple[int, int], int] = {}
        for enrolment_id, person_id, _, course_id in _rows(store):
            assert by_person.setdefault((person_id, course_id), enrolment_id) == enrolment_id


def _rows(store: Store) -> set[tuple[int, int, Role, int]]:
    """Return enrolment, person, role and course for every enrolment with a sign-in."""
    with store.reading() as session:
        query = select(Enrolment.id, Enrolment.person_id, Enrolment.role, Enrolment.course_id).join(Person)
        return {tuple(row) for row in session.execute(query.where(Person.signed_in_at.is_not(None)))}  # type: ignore[misc]


def test_the_next_page_of_members_has_an_address_without_brackets(
    store: Store, platform: Platform, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With "<" in an address, the search would start again at each "<" of a long header.
    replies = iter([PlatformReply([1], f'{"<" * 1000}https://p.example.org/2>; rel="next"'), PlatformReply([2], "")])
    urls = []

    def fetch(url: str, **_: object) -> PlatformReply:
        urls.append(url)
        return next(replies)

    monkeypatch.setattr(services, "_send_request", lambda _platform, url, **_: fetch(url))
    assert list(services._fetch_pages(platform, "https://p.example.org/1", {})) == [[1], [2]]
    assert urls == ["https://p.example.org/1", "https://p.example.org/2"]
