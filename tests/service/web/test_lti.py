"""Launches, members and marks with a platform that simulates LTI 1.3, NRPS 2.0 and AGS 2.0."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import parse_qs, urlsplit

import jwt
import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from httpx2 import Response
from sqlalchemy import func, select, update
from starlette.testclient import TestClient

import report_builders
from builders import echo, grading_request, prepared
from lti_platform import CLIENT, INSTRUCTOR, ISSUER, LEARNER, LearningPlatform, learning_platform
from service.lti.launch import CLAIM
from service.operations import platforms
from service.operations.context import create_machine_actor
from service.operations.errors import Invalid
from service.store.batches import intake
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from service.store.engine import Store
from service.store.people import lti, lti_launches, membership
from service.store.people.lti import Registration
from service.store.queue import jobs
from service.store.states import Role
from service.store.tables.people import LtiCourse, LtiLaunch
from service.store.tables.submissions import Job
from service.web.access import CSRF_FIELD
from service.web.rate_limits import RateLimit
from web import Web, csrf, grade_all, web_in

SAME_SITE = "https://localhost"


@pytest.fixture
def launched(tmp_path: Path) -> Iterator[tuple[Web, LearningPlatform]]:
    with learning_platform() as platform, web_in(tmp_path) as web:
        urls = (f"{platform.url}/auth?x=1", f"{platform.url}/token", f"{platform.url}/keys")
        with web.store.transaction() as session:
            lti.register_platform(session, Registration("Moodle", ISSUER, CLIENT, ("1",), *urls))
        yield web, platform


def _browser(web: Web) -> TestClient:
    return TestClient(web.app, base_url=SAME_SITE, follow_redirects=False)


def _begin(browser: TestClient, **changes: str) -> dict[str, str]:
    parameters = {
        "iss": ISSUER,
        "login_hint": "hint",
        "client_id": CLIENT,
        "target_link_uri": f"{SAME_SITE}/",
    } | changes
    answer = browser.post("/lti/login", data=parameters, headers={"sec-fetch-site": "cross-site"})
    assert answer.status_code == 303, answer.text
    return {name: values[0] for name, values in parse_qs(urlsplit(answer.headers["location"]).query).items()}


def _end(browser: TestClient, state: str, token: str) -> Response:
    headers = {"sec-fetch-site": "cross-site", "origin": "https://platform.example.org"}
    return browser.post("/lti/launch", data={"state": state, "id_token": token}, headers=headers)


def _launch(
    web: Web, platform: LearningPlatform, subject: str, *roles: str, **changes: Any
) -> tuple[TestClient, Response]:
    browser = _browser(web)
    begun = _begin(browser)
    return browser, _end(browser, begun["state"], platform.sign(platform.claims(begun, subject, *roles, **changes)))


def test_an_instructor_and_then_a_student_come_to_a_course_of_its_own(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    _, refused = _launch(web, platform, "ada", LEARNER)
    assert refused.status_code == 422
    assert "No instructor has opened Robomark" in refused.text
    grace, answer = _launch(web, platform, "grace", INSTRUCTOR)
    assert answer.status_code == 303
    assert answer.headers["location"] == "/courses/1/batches"
    assert "Grace Example" in grace.get("/account").text
    ada, answer = _launch(web, platform, "ada", LEARNER)
    assert answer.headers["location"] == "/courses/1/mine"
    assert ada.get("/courses/1/platform").status_code == 404
    assert grace.get("/courses/1/platform").status_code == 200
    with web.store.reading() as session:
        assert [(each.id, each.role) for each in membership.list_members(session, 1)] == [
            ("ada", Role.STUDENT),
            ("grace", Role.INSTRUCTOR),
        ]
        assert [course.name for course in membership.list_courses(session)] == ["Robotics"]
    # The same people again, and a course with the same title in another context.
    _launch(web, platform, "grace", INSTRUCTOR)
    _, answer = _launch(web, platform, "grace", INSTRUCTOR, **{f"{CLAIM}context": {"id": "c2", "title": "Robotics"}})
    assert answer.headers["location"] == "/courses/2/batches"
    with web.store.reading() as session:
        assert [course.name for course in membership.list_courses(session)] == ["Robotics", "Robotics (2)"]
        (first,), (second,) = (
            [each for each in membership.list_members(session, n) if each.id == "grace"] for n in (1, 2)
        )
        assert first.person_id == second.person_id


_OTHER_KEY = rsa.generate_private_key(65537, 2048)
_NOW = int(time.time())


@pytest.mark.long
@pytest.mark.parametrize(
    ("changes", "header", "sentence"),
    [
        pytest.param({"aud": "somebody else"}, {}, "token is invalid", id="for another client"),
        pytest.param({"aud": [CLIENT, "other"], "azp": "other"}, {}, "another tool", id="for another party"),
        pytest.param({"azp": "other"}, {}, "another tool", id="for us, presented by another party"),
        pytest.param({"aud": [CLIENT, "other"]}, {}, "another tool", id="for several, presented by nobody"),
        pytest.param({"iss": "https://evil.example.org"}, {}, "token is invalid", id="of another issuer"),
        pytest.param({"exp": _NOW - 3600, "iat": _NOW - 7200}, {}, "token is invalid", id="expired"),
        pytest.param({"nonce": "another"}, {}, "already used", id="another nonce"),
        pytest.param({"nonce": None}, {}, "token is invalid", id="no nonce"),
        pytest.param({"sub": None}, {}, "token is invalid", id="nobody"),
        pytest.param({f"{CLAIM}deployment_id": "2"}, {}, "deployment", id="another deployment"),
        pytest.param({f"{CLAIM}deployment_id": ["1"]}, {}, "deployment", id="a list for a deployment"),
        pytest.param({f"{CLAIM}version": "1.1"}, {}, "does not use LTI 1.3", id="another version"),
        pytest.param({f"{CLAIM}message_type": "LtiDeepLinkingRequest"}, {}, "link in a course", id="another message"),
        pytest.param({f"{CLAIM}context": None}, {}, "no course", id="no course"),
        pytest.param({}, {"key": _OTHER_KEY}, "token is invalid", id="another key"),
        pytest.param({}, {"kid": "k9"}, "token is invalid", id="an unknown key"),
    ],
)
def test_a_word_that_is_not_to_be_trusted_signs_nobody_in(
    launched: tuple[Web, LearningPlatform], changes: dict[str, Any], header: dict[str, Any], sentence: str
) -> None:
    web, platform = launched
    browser = _browser(web)
    begun = _begin(browser)
    token = platform.sign(platform.claims(begun, "grace", INSTRUCTOR, **changes), **header)
    answer = _end(browser, begun["state"], token)
    assert answer.status_code == 422
    assert sentence in answer.text
    assert browser.get("/account").status_code == 303
    # Only the key itself has to be requested; everything else is checked before.
    assert platform.paths == ["/keys"] * bool(header)


@pytest.mark.parametrize("token", ["", "x", "a.b.c", "eyJhbGciOiJub25lIn0.e30."])
def test_what_is_no_token_is_refused(launched: tuple[Web, LearningPlatform], token: str) -> None:
    web, platform = launched
    browser = _browser(web)
    assert _end(browser, _begin(browser)["state"], token).status_code == 422
    assert platform.paths == []


@pytest.mark.parametrize("algorithm", ["none", "HS256"])
def test_a_token_with_another_algorithm_is_refused(launched: tuple[Web, LearningPlatform], algorithm: str) -> None:
    web, platform = launched
    browser = _browser(web)
    begun = _begin(browser)
    key = "" if algorithm == "none" else "k" * 64
    token = jwt.encode(platform.claims(begun, "grace", INSTRUCTOR), key, algorithm, headers={"kid": "k1"})
    answer = _end(browser, begun["state"], token)
    assert answer.status_code == 422
    assert "token is invalid" in answer.text
    assert platform.paths == []


def test_a_launch_counts_once_and_in_the_browser_that_began_it(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    browser, other = _browser(web), _browser(web)
    begun = _begin(browser)
    token = platform.sign(platform.claims(begun, "grace", INSTRUCTOR))
    assert "another browser" in _end(other, begun["state"], token).text
    assert _end(browser, begun["state"], token).status_code == 303
    browser.cookies.set("robomark_launch", begun["state"], domain="localhost.local", path="/lti")
    assert _end(browser, begun["state"], token).status_code == 422


@pytest.mark.long
@pytest.mark.parametrize(
    ("target", "path"),
    [
        (f"{SAME_SITE}/courses/1/platform", "/courses/1/platform"),
        ("https://evil.example.org/", "/courses/1/batches"),
        (f"{SAME_SITE}.evil.example.org/", "/courses/1/batches"),
        (f"{SAME_SITE}//evil.example.org/", "/courses/1/batches"),
        (f"{SAME_SITE}/\\evil.example.org", "/courses/1/batches"),
    ],
)
def test_a_launch_leads_nowhere_but_here(launched: tuple[Web, LearningPlatform], target: str, path: str) -> None:
    web, platform = launched
    browser = _browser(web)
    begun = _begin(browser, target_link_uri=target)
    answer = _end(browser, begun["state"], platform.sign(platform.claims(begun, "grace", INSTRUCTOR)))
    assert answer.headers["location"] == path


def test_a_platform_that_nobody_registered_begins_nothing(launched: tuple[Web, LearningPlatform]) -> None:
    browser = _browser(launched[0])
    answer = browser.get("/lti/login", params={"iss": "https://evil.example.org", "login_hint": "x"})
    assert answer.status_code == 422
    assert "registered" in answer.text


def test_nobody_who_is_unknown_waits_for_writers_or_lets_them_wait(
    launched: tuple[Web, LearningPlatform], monkeypatch: pytest.MonkeyPatch
) -> None:
    browser = _browser(launched[0])
    keys = browser.get("/lti/keys").json()
    browser.cookies.set("robomark_launch", "unknown", domain="localhost.local", path="/lti")

    def refuse(store: Store) -> NoReturn:
        raise AssertionError(f"{store} was written to")

    monkeypatch.setattr(Store, "transaction", refuse)
    assert browser.get("/lti/keys").json() == keys
    assert _end(browser, "unknown", "x").status_code == 422
    for secret in ("x", "rms_x", "rml_x", "rmt_x"):
        assert browser.post("/sign-in", data={"secret": secret}).status_code == 403


def test_launches_from_unknown_platforms_keep_no_known_one_out(
    launched: tuple[Web, LearningPlatform], monkeypatch: pytest.MonkeyPatch
) -> None:
    context = launched[0].app.state.context
    three = RateLimit(burst=3, per_minute=3, clock=lambda: 0.0)
    limits = replace(context.limits, unknown_platforms=three)
    monkeypatch.setattr(launched[0].app.state, "context", replace(context, limits=limits))
    browser, unknown = _browser(launched[0]), {"iss": "https://evil.example.org", "login_hint": "x"}
    statuses = [browser.get("/lti/login", params=unknown).status_code for _ in range(4)]
    assert statuses == [422, 422, 422, 429]
    _begin(browser)


def test_the_oldest_launches_make_room_for_new_ones(
    launched: tuple[Web, LearningPlatform], monkeypatch: pytest.MonkeyPatch
) -> None:
    web, platform = launched
    monkeypatch.setattr(lti_launches, "MAX_PENDING", 3)
    browsers = [_browser(web) for _ in range(5)]
    begun = [_begin(browser) for browser in browsers]
    with web.store.reading() as session:
        assert session.scalar(select(func.count()).select_from(LtiLaunch)) == 3
    answers = [
        _end(browser, each["state"], platform.sign(platform.claims(each, "grace", INSTRUCTOR)))
        for browser, each in zip(browsers, begun, strict=True)
    ]
    assert [answer.status_code for answer in answers] == [422, 422, 303, 303, 303]


def test_nobody_becomes_somebody_else_by_an_id_that_a_platform_tells(
    launched: tuple[Web, LearningPlatform],
) -> None:
    web, platform = launched
    _launch(web, platform, "grace", INSTRUCTOR)
    web.student("ada", "Robotics")
    web.instructor("alan", "Robotics")
    web.student("bob", "Robotics")
    _, first = _launch(web, platform, "ada", LEARNER)
    assert first.status_code == 303
    for subject, taken in (("eve", "ada"), ("eve", "alan"), ("eve", "grace")):
        browser, refused = _launch(web, platform, subject, LEARNER, **{f"{CLAIM}lis": {"person_sourcedid": taken}})
        assert refused.status_code == 422, taken
        assert "Another person already has the ID" in refused.text
        assert browser.get("/account").status_code == 303
    with web.store.reading() as session:
        assert {each.id: each.name for each in membership.list_members(session, 1)}["alan"] == "Alan"


def test_what_a_platform_lists_wrongly_is_passed_over(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    platform.tool_keys = _browser(web).get("/lti/keys").json()
    grace, _ = _launch(web, platform, "grace", INSTRUCTOR)
    platform.members = [
        {"user_id": 7, "roles": [LEARNER]},
        {"user_id": "ada", "roles": "x", "name": ["Ada"], "lis_person_sourcedid": 12, "email": {}},
        {"user_id": "eve", "roles": [LEARNER], "lis_person_sourcedid": "grace"},
    ]
    answer = grace.post("/courses/1/platform/members", data={CSRF_FIELD: csrf(grace.get("/account"))})
    assert answer.status_code == 200, answer.text
    assert "1 platform member is enrolled. 1 member is not enrolled:" in answer.text


def test_members_are_enrolled_and_published_marks_sent(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    platform.tool_keys = _browser(web).get("/lti/keys").json()
    grace, _ = _launch(web, platform, "grace", INSTRUCTOR)
    platform.members = [
        {"user_id": "grace", "name": "Grace Example", "roles": ["Instructor"], "lis_person_sourcedid": "grace"},
        {"user_id": "ada", "name": "Ada Example", "roles": ["Learner"], "lis_person_sourcedid": "ada"},
        {"user_id": "bob", "given_name": "Bob", "family_name": "Example", "roles": [LEARNER], "status": "Active"},
        {"user_id": "eve", "roles": [LEARNER], "status": "Inactive"},
    ]
    word = csrf(grace.get("/account"))
    answer = grace.post("/courses/1/platform/members", data={CSRF_FIELD: word})
    assert "3 platform members are enrolled" in answer.text, answer.text
    with web.store.reading() as session:
        assert [each.name for each in membership.list_members(session, 1)] == [
            "Bob Example",
            "Ada Example",
            "Grace Example",
        ]
    requests = [grading_request("ada"), grading_request("unknown")]
    intake.accept_batch(web.store, "b", requests, (), course="Robotics", max_attempts=3)
    while claim := jobs.claim_job(web.store, "worker", 60):
        jobs.finish_job(web.store, claim, prepared(report_builders.faulty_grade()), datetime.now(UTC))
    send = {CSRF_FIELD: word, "assignment": "echo-responder"}
    assert "0 published marks" in grace.post("/courses/1/platform/marks", data=send).text
    assert platform.scores == []
    with web.store.transaction() as session:
        session.execute(update(Job).values(published_at=datetime.now(UTC), published_by="grace"))
    for _ in range(2):
        assert "1 published mark sent" in grace.post("/courses/1/platform/marks", data=send).text
    assert len(platform.columns) == 1
    graded = report_builders.faulty_grade()
    assert [(each["userId"], each["scoreGiven"], each["scoreMaximum"]) for each in platform.scores] == [
        ("ada", float(graded.marks), float(graded.max_marks))
    ] * 2
    missing = grace.post("/courses/1/platform/marks", data={**send, "assignment": "shape-recognition"})
    assert missing.status_code == 422


def test_no_marks_are_sent_while_names_are_hidden(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    platform.tool_keys = _browser(web).get("/lti/keys").json()
    grace, _ = _launch(web, platform, "grace", INSTRUCTOR)
    platform.members = [{"user_id": "ada", "name": "Ada Example", "roles": ["Learner"], "lis_person_sourcedid": "ada"}]
    word = csrf(grace.get("/account"))
    grace.post("/courses/1/platform/members", data={CSRF_FIELD: word})
    intake.accept_batch(web.store, "b", [grading_request("ada")], (), course="Robotics", max_attempts=3)
    grade_all(web, report_builders.faulty_grade())
    with web.store.transaction() as session:
        session.execute(update(Job).values(published_at=datetime.now(UTC), published_by="grace"))
        open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
        open_assignments.hide_names(session, 1, "echo-responder", True)
    send = {CSRF_FIELD: word, "assignment": "echo-responder"}
    refused = grace.post("/courses/1/platform/marks", data=send)
    assert (refused.status_code, "names are hidden for echo-responder" in refused.text) == (422, True)
    service = web.app.state.context.service
    with pytest.raises(Invalid):
        platforms.pass_back(service, create_machine_actor(), 1, "echo-responder")
    assert platform.scores == []


def test_a_platform_that_does_not_answer_is_said_so(launched: tuple[Web, LearningPlatform]) -> None:
    web, platform = launched
    grace, _ = _launch(web, platform, "grace", INSTRUCTOR)
    platform.tool_keys = _browser(web).get("/lti/keys").json()
    with web.store.transaction() as session:
        session.execute(update(LtiCourse).values(members_url=f"{platform.url}/nowhere"))
    answer = grace.post("/courses/1/platform/members", data={CSRF_FIELD: csrf(grace.get("/account"))})
    assert answer.status_code == 502
    assert re.search(r"The platform at 127.0.0.1:\d+ returned status 403", answer.text)
