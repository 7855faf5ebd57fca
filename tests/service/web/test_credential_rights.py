"""A credential has no more rights than its issuer, and ends with the role. Its owner and operators can revoke it."""

from __future__ import annotations

import hashlib
import io
import json
import tomllib
import zipfile
from datetime import timedelta

import pytest
from sqlalchemy import select, update
from starlette.testclient import TestClient

from paths import DATA
from service.operations import people as operations
from service.operations.context import Actor
from service.operations.scopes import SCOPES
from service.store.engine import now
from service.store.people import credentials, lti, membership, revocation
from service.store.people.credentials import MAX_SESSIONS, MAX_TOKENS
from service.store.people.lti import Registration
from service.store.people.membership import Member
from service.store.people.reach import Reach
from service.store.people.students import Students
from service.store.states import CredentialKind, Role
from service.store.tables.people import Credential, Enrolment, LtiCourse, LtiPerson
from service.web.access import SESSION_COOKIE, find_page_scope
from sim.errors import UsageError
from submissions.student_identity import Student
from web import Web, csrf, submit, words

EVERY_SCOPE = tuple(SCOPES)


def also_in(web: Web, member: Member, course: str, role: Role) -> Member:
    """Enrol the same person in another course."""
    with web.store.transaction() as session:
        other = (membership.make_student if role is Role.STUDENT else membership.make_instructor)(
            session, course, Student(f"{member.id}-{course}", "Also Ada")
        )
    web.join(member, other)
    return other


def token_of(browser: TestClient, *scopes: str) -> dict[str, str]:
    """Return a token created on the account page."""
    data = {"name": "t", "days": "366", "word": f"w{len(scopes)}", "scopes": list(scopes)}
    answer = submit(browser, "/account/tokens", data)
    assert answer.status_code == 303, answer.text
    secret = browser.get(answer.headers["location"]).text.partition('readonly value="')[2].partition('"')[0]
    assert secret.startswith("rmt_")
    return {"authorization": f"Bearer {secret}"}


def sign_in(web: Web, secret: str) -> TestClient:
    browser = web.browser()
    assert browser.post("/sign-in", data={"secret": secret}).status_code == 303
    return browser


def instructors_link(web: Web, grace: TestClient, ada: Member) -> str:
    answer = submit(grace, f"/courses/1/people/{ada.enrolment_id}/link")
    return grace.get(answer.headers["location"]).text.partition("/sign-in/")[2].partition('"')[0]


def credential(web: Web, member: Member, kind: CredentialKind, **reach: object) -> str:
    with web.store.transaction() as session:
        limits = Reach(**reach)  # type: ignore[arg-type]
        return credentials.issue_credential(session, member.person_id, kind, timedelta(hours=1), reach=limits)


@pytest.fixture
def ada(web: Web, grace: TestClient) -> Member:
    return web.student("ada")


def test_an_instructors_link_reaches_one_course_and_one_role(web: Web, grace: TestClient, ada: Member) -> None:
    """All sessions derived from it are limited too, whatever the owner's later roles are, without signing out."""
    browser = sign_in(web, instructors_link(web, grace, ada))
    token = token_of(browser, "read", "submit", "sign-in")
    second = sign_in(web, token["authorization"].removeprefix("Bearer "))
    unused = instructors_link(web, grace, ada)
    with web.store.transaction() as session:
        elsewhere = membership.make_student(session, "two", Student("ada"))
        staff = membership.make_instructor(session, "three", Student("ada"))
        for each in (elsewhere, staff):
            session.get_one(Enrolment, each.enrolment_id).person_id = ada.person_id
        membership.make_operator(session, ada.person_id)
    for signed_in in (browser, second, sign_in(web, unused)):
        assert signed_in.get("/courses/1/mine").status_code == 200
        assert signed_in.get("/courses/2/mine").status_code == 404
        assert signed_in.get("/courses/3/people").status_code == 404
        assert signed_in.get("/operator").status_code == 404
    document = web.browser().get("/api/v1/me", headers=token).json()
    assert ([course["id"] for course in document["courses"]], document["operator"]) == ([1], False)
    assert web.browser().get("/api/v1/courses/2/mine/assignments", headers=token).status_code == 404
    # It does not give access to the same course in another role either.
    with web.store.transaction() as session:
        session.execute(update(Enrolment).where(Enrolment.id == ada.enrolment_id).values(role=Role.INSTRUCTOR))
    assert browser.get("/courses/1/people").status_code == 404
    assert browser.get("/courses/1/mine").status_code == 404


def test_links_for_a_whole_course_reach_as_far(web: Web, ada: Member) -> None:
    token = web.token(web.instructor(), "manage")
    (made,) = web.browser().post("/api/v1/courses/1/people/links", headers=token).json()["links"]
    browser = sign_in(web, made["path"].rpartition("/")[2])
    with web.store.transaction() as session:
        other = membership.make_student(session, "two", Student("ada"))
        session.get_one(Enrolment, other.enrolment_id).person_id = ada.person_id
    assert browser.get("/courses/1/mine").status_code == 200
    assert browser.get("/courses/2/mine").status_code == 404


def test_a_token_opens_no_browser_that_may_more(web: Web) -> None:
    root = web.operator()
    with web.store.transaction() as session:
        course = membership.make_instructor(session, "A", Student("root"))
        session.get_one(Enrolment, course.enrolment_id).person_id = root.person_id
    scopes = frozenset({"read", "sign-in"})
    secret = credential(web, root, CredentialKind.TOKEN, course_id=course.course_id, scopes=scopes)
    browser = sign_in(web, secret)
    assert browser.get(f"/courses/{course.course_id}/people").status_code == 200
    assert browser.get(f"/courses/{root.course_id}/people").status_code == 404
    assert browser.get("/operator").status_code == 404
    # The browser has no more rights than the token's scopes.
    answer = submit(browser, f"/courses/{course.course_id}/people", {"who": "new"})
    assert answer.status_code == 403
    assert "does not have the scope" in answer.text
    offered = browser.get("/account").text
    assert [scope for scope in SCOPES if f'value="{scope}"' in offered] == ["read", "sign-in"]
    wider = {"name": "t", "word": "w", "scopes": ["read", "manage"]}
    assert submit(browser, "/account/tokens", wider).status_code == 422
    follows = token_of(browser, "read")
    document = web.browser().get("/api/v1/me", headers=follows).json()
    assert ([each["id"] for each in document["courses"]], document["scopes"]) == ([course.course_id], ["read"])


def test_a_token_without_course_but_with_scopes_limits_its_browser(web: Web) -> None:
    browser = sign_in(web, credential(web, web.operator(), CredentialKind.TOKEN, scopes=frozenset({"read", "sign-in"})))
    assert browser.get("/operator").status_code == 200
    assert submit(browser, "/operator/retry").status_code == 403
    scopes = frozenset({"read", "manage", "sign-in"})
    staff = sign_in(web, credential(web, web.instructor("grace", "operators"), CredentialKind.TOKEN, scopes=scopes))
    assert submit(staff, "/courses/1/people", {"who": "new"}).status_code == 303
    assert submit(staff, "/courses/1/batches/x/publish").status_code == 403
    only = sign_in(web, credential(web, web.student(), CredentialKind.TOKEN, scopes=frozenset({"sign-in"})))
    assert only.get("/courses/2/mine").status_code == 403
    assert submit(only, "/sign-out").status_code == 303


def _scopes_of_pages() -> dict[str, str]:
    """Return the scope of the API route that corresponds to each page."""
    routes = {
        route: who.split()[-1]
        for table in sorted((DATA / "access").glob("*.toml"))
        for route, who in tomllib.loads(table.read_text()).items()
    }
    pages = tomllib.loads((DATA / "page_to_api.toml").read_text())
    return {page: routes[api.replace(" /", " /api/v1/", 1)] for page, api in pages.items() if "none: " not in api}


@pytest.mark.parametrize(("page", "scope"), sorted(_scopes_of_pages().items()))
def test_a_page_needs_the_scope_of_its_route_of_the_api(page: str, scope: str) -> None:
    method, route = page.split(" ")
    if page not in ("GET /", "GET /account") and not (method == "GET" and route.endswith("/uploads/{upload_id}")):
        assert find_page_scope(method, route) == scope


def test_a_platforms_session_reaches_the_platforms_courses(web: Web) -> None:
    member = web.operator()
    with web.store.transaction() as session:
        urls = ("https://p.example.org/a", "https://p.example.org/t", "https://p.example.org/k")
        platform = lti.register_platform(session, Registration("Moodle", "i", "c", ("1",), *urls))
        local = membership.make_instructor(session, "local", Student("root"))
        launched = membership.make_instructor(session, "launched", Student("root"))
        for each in (local, launched):
            session.get_one(Enrolment, each.enrolment_id).person_id = member.person_id
        session.add(LtiCourse(platform_id=platform, deployment="1", context="c", course_id=launched.course_id))
    browser = web.browser()
    secret = credential(web, member, CredentialKind.SESSION, platform_id=platform)
    browser.cookies.set(SESSION_COOKIE, secret, domain="localhost.local")
    assert browser.get(f"/courses/{launched.course_id}/people").status_code == 200
    for path in (f"/courses/{local.course_id}/people", "/operator"):
        assert browser.get(path).status_code == 404
    document = web.browser().get("/api/v1/me", headers=token_of(browser, *EVERY_SCOPE)).json()
    assert [each["id"] for each in document["courses"]] == [launched.course_id]


def test_owners_see_and_end_their_sessions_and_tokens(web: Web, ada: Member) -> None:
    browser, other = web.browser(ada), web.browser(ada)
    token = token_of(browser, "read", "sign-in")
    listed = web.browser().get("/api/v1/me/credentials", headers=token).json()["items"]
    assert sorted(each["kind"] for each in listed) == ["session", "session", "token"]
    page_text = browser.get("/account").text
    assert page_text.count("/account/sessions/") == 1
    (ends,) = [each["id"] for each in listed if f"/account/sessions/{each['id']}/end" in page_text]
    assert submit(browser, f"/account/sessions/{ends}/end").status_code == 303
    assert other.get("/account").status_code == 303
    assert submit(browser, f"/account/sessions/{ends}/end").status_code == 404
    third = web.browser(ada)
    assert submit(browser, "/account/end-others").status_code == 303
    assert third.get("/account").status_code == 303
    assert browser.get("/account").status_code == 200
    assert web.browser().get("/api/v1/me", headers=token).status_code == 401


def test_what_is_made_with_a_token_lasts_no_longer_than_the_token(web: Web, ada: Member) -> None:
    """Also tokens made in a browser that a token signed in, and browsers and tokens of these, at any depth."""
    with web.store.transaction() as session:
        reach = Reach(scopes=frozenset({"sign-in", "read"}))
        day = timedelta(days=1)
        first = credentials.issue_credential(
            session, ada.person_id, CredentialKind.TOKEN, day, name="first", reach=reach
        )
    made = []
    secret = first
    for _ in range(3):
        bearer = token_of(sign_in(web, secret), "sign-in", "read")
        secret = bearer["authorization"].removeprefix("Bearer ")
        made.append(bearer)
    browser, other = sign_in(web, secret), token_of(web.browser(ada), "read")
    with web.store.transaction() as session:
        row = credentials.identify(session, first, CredentialKind.TOKEN)
        assert row is not None
        until = session.get_one(Credential, row.credential_id).expires_at
        for bearer in made:
            own = session.scalars(select(Credential).where(Credential.sha256 == _sha256(bearer))).one()
            assert own.expires_at == until
    assert all(web.browser().get("/api/v1/me", headers=each).status_code == 200 for each in (*made, other))
    with web.store.transaction() as session:
        revocation.revoke_credential(session, row.credential_id, ada.person_id)
    assert {web.browser().get("/api/v1/me", headers=each).status_code for each in made} == {401}
    assert web.browser().get("/api/v1/me", headers=other).status_code == 200
    assert browser.get("/account").status_code == 303


def _sha256(bearer: dict[str, str]) -> str:
    return hashlib.sha256(bearer["authorization"].removeprefix("Bearer ").encode()).hexdigest()


def test_programs_end_sessions_and_tokens(web: Web, ada: Member) -> None:
    browser = web.browser(ada)
    token, program = token_of(browser, "read", "sign-in"), web.browser()
    listed = program.get("/api/v1/me/credentials", headers=token).json()["items"]
    assert program.delete("/api/v1/me/credentials/0123456789ab", headers=token).status_code == 404
    for each in sorted(listed, key=lambda each: each["kind"]):
        assert program.delete(f"/api/v1/me/credentials/{each['id']}", headers=token).status_code == 204
    assert browser.get("/account").status_code == 303
    assert program.get("/api/v1/me", headers=token).status_code == 401


def test_a_limited_session_sees_and_ends_nothing_beyond_its_reach(web: Web, grace: TestClient, ada: Member) -> None:
    own = web.browser(ada)
    token = token_of(own, "read")
    limited = sign_in(web, instructors_link(web, grace, ada))
    listed = web.browser().get("/api/v1/me/credentials", headers=token_of(limited, "read", "sign-in")).json()["items"]
    assert {each["course_id"] for each in listed} == {1}
    for each in web.browser().get("/api/v1/me/credentials", headers=token).json()["items"]:
        if each["course_id"] is None:
            assert submit(limited, f"/account/sessions/{each['id']}/end").status_code == 404
    submit(limited, "/account/end-others")
    assert own.get("/account").status_code == 200


@pytest.mark.parametrize("how", ["command", "platform", "removed"])
def test_the_loss_of_a_role_ends_what_reaches_the_course(web: Web, how: str) -> None:
    linus = web.instructor("linus")
    elsewhere = credential(web, web.student("x", "two"), CredentialKind.TOKEN, scopes=frozenset({"read"}))
    with web.store.transaction() as session:
        two = membership.make_student(session, "two", Student("linus2"))
        session.get_one(Enrolment, two.enrolment_id).person_id = linus.person_id
    browser, link = web.browser(linus), web.link(linus)
    tokens = {
        course_id: credential(web, linus, CredentialKind.TOKEN, course_id=course_id, scopes=frozenset({"read"}))
        for course_id in (None, 1, two.course_id)
    }
    with web.store.transaction() as session:
        if how == "command":
            membership.make_student(session, "default", Student("linus"))
        elif how == "platform":
            membership.set_role(session, session.get_one(Enrolment, linus.enrolment_id), Role.STUDENT)
    if how == "removed":
        root = web.browser(web.operator())
        assert root.get("/operator").status_code == 200
        _remove(web, linus)
    assert browser.get("/account").status_code == 303
    assert web.browser().post("/sign-in", data={"secret": link}).status_code == 403
    counts = {
        course_id: web.browser().get("/api/v1/me", headers={"authorization": f"Bearer {secret}"}).status_code
        for course_id, secret in tokens.items()
    }
    assert counts == {None: 401, 1: 401, two.course_id: 200}
    assert web.browser().get("/api/v1/me", headers={"authorization": f"Bearer {elsewhere}"}).status_code == 200


def _remove(web: Web, member: Member) -> None:
    service = web.app.state.context.service
    operations.remove(service, Actor("root", operator=True), member.course_id, member.enrolment_id)


@pytest.mark.long
def test_the_number_of_sessions_and_tokens_is_bounded(web: Web, ada: Member) -> None:
    first = web.browser(ada)
    browsers = [web.browser(ada) for _ in range(MAX_SESSIONS)]
    assert first.get("/account").status_code == 303
    assert all(each.get("/account").status_code == 200 for each in browsers)
    browser = browsers[0]
    for number in range(MAX_TOKENS + 1):
        body = {"name": "t", "word": f"w{number}", "scopes": ["read"]}
        answer = submit(browser, "/account/tokens", body)
        assert answer.status_code == (303 if number < MAX_TOKENS else 409)
    assert "Revoke a token first" in answer.text
    # The same form again creates nothing new, so it gets the same answer.
    assert submit(browser, "/account/tokens", {"name": "t", "word": "w0", "scopes": ["read"]}).status_code == 303


def test_students_are_offered_what_students_may_do(web: Web, grace: TestClient, ada: Member) -> None:
    browser = web.browser(ada)
    page_text = browser.get("/account").text
    assert [scope for scope in SCOPES if f'value="{scope}"' in page_text] == ["read", "submit", "sign-in"]
    page_text = grace.get("/account").text
    assert [scope for scope in SCOPES if f'value="{scope}"' in page_text] == list(SCOPES)
    for scope in ("mark", "manage", "nothing"):
        body = {"name": "t", "word": "w", "scopes": ["read", scope]}
        refused = submit(browser, "/account/tokens", body)
        assert (refused.status_code, "read, submit, sign-in" in words(refused.text)) == (422, True)


def test_a_name_is_that_of_its_course(web: Web, grace: TestClient, ada: Member) -> None:
    other = also_in(web, ada, "two", Role.STUDENT)
    table = {"file": ("x.csv", b"id,name,email\nada,Renamed,renamed@example.org\n")}
    assert submit(grace, "/courses/1/people/table", files=table).status_code == 303
    with web.store.reading() as session:
        names = {
            each.course_id: (each.name, each.email) for _, each in membership.load_enrolments(session, ada.person_id)
        }
    assert names == {1: ("Renamed", "renamed@example.org"), other.course_id: ("Also Ada", "")}
    linus = web.browser(web.instructor("linus", "two"))
    assert "Renamed" not in linus.get(f"/courses/{other.course_id}/people").text


def test_a_courses_data_tells_no_credentials_of_another(web: Web, ada: Member) -> None:
    also_in(web, ada, "two", Role.STUDENT)
    with web.store.transaction() as session:
        for name, course_id in (("here", 1), ("there", 2), ("everywhere", None)):
            reach = Reach(course_id=course_id, scopes=frozenset({"read"}))
            kind = CredentialKind.TOKEN
            credentials.issue_credential(session, ada.person_id, kind, timedelta(hours=1), name=name, reach=reach)
    headers = web.token(web.instructor(), "manage")
    packed = web.browser().get(f"/api/v1/courses/1/people/{ada.enrolment_id}/data", headers=headers).content
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        document = json.loads(archive.read("student.json"))
    assert [each["name"] for each in document["signed_in_with"]] == ["here"]


def test_a_stored_answer_ends_with_the_role(web: Web) -> None:
    grace = web.instructor()
    headers = web.token(grace, "manage") | {"idempotency-key": "k"}
    path, body = "/api/v1/courses/1/people", {"students": [{"id": "bob"}]}
    for _ in range(2):
        assert web.browser().post(path, headers=headers, json=body).status_code == 201
    with web.store.transaction() as session:
        # Also without the condition that would end the token.
        session.execute(update(Enrolment).where(Enrolment.id == grace.enrolment_id).values(role=Role.STUDENT))
    assert web.browser().post(path, headers=headers, json=body).status_code == 404


def test_an_operator_signs_somebody_out(web: Web, ada: Member) -> None:
    root, browser, token = web.browser(web.operator()), web.browser(ada), web.token(ada, "read")
    where = root.get("/operator/people", params={"course": "default", "who": "ada"}).headers["location"]
    assert "session" in words(root.get(where).text)
    answer = submit(root, f"{where}/sign-out")
    assert "Signed out: 2 links, sessions and tokens ended" in words(root.get(answer.headers["location"]).text)
    assert browser.get("/account").status_code == 303
    assert web.browser().get("/api/v1/me", headers=token).status_code == 401
    program = web.token(web.operator(), "read", "manage")
    browser = web.browser(ada)
    path = f"/api/v1{where}/sign-out"
    assert web.browser().post(path, headers=program, json={"release": True}).json() == {"ended": 1}
    assert browser.get("/account").status_code == 303


def test_a_released_place_is_the_next_launchs(web: Web, grace: TestClient) -> None:
    with web.store.transaction() as session:
        urls = ("https://p.example.org/a", "https://p.example.org/t", "https://p.example.org/k")
        lti.register_platform(session, Registration("Moodle", "i", "c", ("1",), *urls))
        (platform,) = lti.list_platforms(session)
        student = Students(session, 1).enrol(Student("ada"), now(session))
        person_id = session.get_one(Enrolment, student).person_id
        credentials.issue_credential(session, person_id, CredentialKind.SESSION, timedelta(hours=1))
    root = web.browser(web.operator())
    for release in (False, True):
        submit(root, f"/operator/people/{student}/sign-out", {"release": "true"} if release else {})
        with web.store.transaction() as session:
            try:
                lti.enrol_subject(session, platform, 1, "subject", Student("ada"), Role.STUDENT)
                taken = True
            except UsageError:
                taken = False
        assert taken is release


def test_an_operator_joins_two_whom_the_form_names(web: Web) -> None:
    root = web.browser(web.operator())
    first = web.instructor("grace", "one")
    browser = web.browser(first)
    where = submit(root, "/operator/courses", {"course": "two", "who": "grace", "name": "G. Hopper"})
    page_text = root.get(where.headers["location"]).text
    assert "Grace (grace) is also an instructor of one." in words(page_text)
    target = page_text.partition('href="/operator/people/')[2].partition('"')[0].replace("&amp;", "&")
    both = root.get(f"/operator/people/{target}").text
    assert "This joins G. Hopper and Grace into one person with all these courses" in words(both)
    second = int(target.partition("?")[0])
    data = {"other_id": str(first.enrolment_id), "csrf": csrf(root.get("/account"))}
    assert root.post(f"/operator/people/{second}/join", data=data).status_code == 303
    assert browser.get("/account").status_code == 303
    with web.store.reading() as session:
        person_id = session.get_one(Enrolment, second).person_id
        assert [course for course, _ in membership.load_enrolments(session, person_id)] == ["one", "two"]
    assert root.post(f"/operator/people/{second}/join", data=data).status_code == 409


def test_programs_join_and_say_whom_an_id_is_shared_with(web: Web) -> None:
    program, headers = web.browser(), web.token(web.operator(), "read", "manage")
    made = [
        program.post("/api/v1/operator/courses", headers=headers, json={"course": course, "id": "grace"}).json()
        for course in ("one", "two")
    ]
    assert [each["elsewhere"] for each in made] == [
        [],
        [{"course": "one", "enrolment": made[0]["enrolment"], "name": ""}],
    ]
    path = f"/api/v1/operator/people/{made[1]['enrolment']}/join"
    joined = program.post(path, headers=headers, json={"other": made[0]["enrolment"]})
    assert sorted(each["course"] for each in joined.json()["enrolments"]) == ["one", "two"]
    document = program.get("/api/v1/operator/people", headers=headers, params={"course": "one", "id": "grace"}).json()
    assert document == joined.json()


@pytest.mark.parametrize("case", ["the same course", "a platform's person", "nobody"])
def test_who_is_not_joined(web: Web, case: str) -> None:
    headers = web.token(web.operator(), "manage")
    first = web.instructor("grace", "one")
    second = web.instructor("linus", "one" if case == "the same course" else "two")
    other = 10_000 if case == "nobody" else second.enrolment_id
    if case == "a platform's person":
        with web.store.transaction() as session:
            urls = ("https://p.example.org/a", "https://p.example.org/t", "https://p.example.org/k")
            platform = lti.register_platform(session, Registration("Moodle", "i", "c", ("1",), *urls))
            session.add(LtiPerson(platform_id=platform, subject="s", person_id=second.person_id))
    path = f"/api/v1/operator/people/{first.enrolment_id}/join"
    answer = web.browser().post(path, headers=headers, json={"other": other})
    status = {"the same course": 409, "a platform's person": 422, "nobody": 404}[case]
    assert answer.status_code == status, answer.text
    if case == "a platform's person":
        joined = web.browser().post(path, headers=headers, json={"other": other, "from_platform": True})
        assert joined.status_code == 200
