"""Signing in and out: valid credentials, rate limits, the people affected, and data left in the browser."""

from __future__ import annotations

import re
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import select

from command import robomark
from service.store.people import credentials, membership, revocation
from service.store.people.membership import Member
from service.store.people.reach import Reach
from service.store.states import CredentialKind, Role
from service.store.tables.people import Credential
from service.web.access import SESSION_COOKIE
from sim.errors import UsageError
from submissions.student_identity import Student
from web import Web, csrf, submit


def test_a_link_counts_once_and_only_when_its_button_is_pressed(web: Web) -> None:
    link = web.link(web.student())
    browser, other = web.browser(), web.browser()
    for _ in range(3):
        response = browser.get(f"/sign-in/{link}")
        assert "This link signs you in as Ada" in response.text
        assert SESSION_COOKIE not in response.cookies
    answer = browser.post("/sign-in", data={"secret": f"http://localhost/sign-in/{link}", "next": "/account"})
    assert (answer.status_code, answer.headers["location"]) == (303, "/account")
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=lax" in cookie
    assert "Ada" in browser.get("/account").text
    assert other.post("/sign-in", data={"secret": link}).status_code == 403
    assert other.get(f"/sign-in/{link}").status_code == 410


def test_a_session_is_new_at_each_sign_in_and_ends_with_its_leave(web: Web) -> None:
    ada = web.student()
    browser = web.browser()
    browser.cookies.set(SESSION_COOKIE, "rms_chosen-by-somebody-else", domain="localhost.local")
    browser.post("/sign-in", data={"secret": web.link(ada)})
    first = next(cookie.value for cookie in browser.cookies.jar if cookie.value and cookie.value.startswith("rms_"))
    assert first != "rms_chosen-by-somebody-else"
    fresh = web.browser(ada)
    word = csrf(fresh.get("/account"))
    old = fresh.cookies[SESSION_COOKIE]
    answer = fresh.post("/sign-in", data={"secret": web.link(ada), "csrf": word})
    assert answer.status_code == 303
    assert fresh.cookies[SESSION_COOKIE] != old
    with web.store.reading() as session:
        assert credentials.identify(session, old, CredentialKind.SESSION) is None
    kept = fresh.cookies[SESSION_COOKIE]
    assert submit(fresh, "/sign-out").status_code == 303
    with web.store.reading() as session:
        assert credentials.identify(session, kept, CredentialKind.SESSION) is None
    assert fresh.get("/account").status_code == 303


@pytest.mark.parametrize(
    "target",
    [
        "//evil.example.org",
        "https://evil.example.org",
        "/\\evil.example.org",
        "javascript:alert(1)",
        "/a\r\nb: c",
        "x",
        "//[",
        "//\u2100.example.org",
    ],
)
def test_signing_in_leads_nowhere_but_here(web: Web, target: str) -> None:
    answer = web.browser().post("/sign-in", data={"secret": web.link(web.student()), "next": target})
    assert (answer.status_code, answer.headers["location"]) == (303, "/")


def test_what_is_kept_signs_nobody_in(web: Web) -> None:
    ada = web.student()
    link, token = web.link(ada), web.token(ada, "read")["authorization"].removeprefix("Bearer ")
    with web.store.reading() as session:
        rows = session.scalars(select(Credential)).all()
    kept = {value for row in rows for value in vars(row).values() if isinstance(value, str)}
    assert not {link, token} & kept
    for secret in [*kept, "", "rml_", "rms_x", "rmt_x", "x" * 200]:
        assert web.browser().post("/sign-in", data={"secret": secret}).status_code in (403, 422)


def test_a_token_becomes_a_browser_only_where_it_may(web: Web) -> None:
    ada = web.student()
    for scopes, status in ((("read", "submit"), 403), (("sign-in",), 303)):
        secret = web.token(ada, *scopes)["authorization"].removeprefix("Bearer ")
        assert web.browser().post("/sign-in", data={"secret": secret}).status_code == status


def _token_for(web: Web, member: Member, lifetime: timedelta) -> str:
    reach = Reach(scopes=frozenset({"sign-in"}))
    with web.store.transaction() as session:
        return credentials.issue_credential(session, member.person_id, CredentialKind.TOKEN, lifetime, reach=reach)


def test_a_session_started_with_a_token_lasts_no_longer_than_the_token(web: Web) -> None:
    ada, browser = web.student(), web.browser()
    token = _token_for(web, ada, timedelta(minutes=10))
    answer = browser.post("/sign-in", data={"secret": token})
    with web.store.reading() as session:
        ends = dict(session.execute(select(Credential.kind, Credential.expires_at)).all())
    assert timedelta(0) <= ends[CredentialKind.TOKEN] - ends[CredentialKind.SESSION] < timedelta(minutes=1)
    max_age = re.search(r"Max-Age=(\d+)", answer.headers["set-cookie"])
    assert max_age is not None
    assert int(max_age[1]) <= 600


def test_a_session_ends_with_the_token_it_was_started_with(web: Web) -> None:
    ada, browser, other = web.student(), web.browser(), web.browser()
    first, second = (_token_for(web, ada, timedelta(days=30)) for _ in range(2))
    assert browser.post("/sign-in", data={"secret": first}).status_code == 303
    assert other.post("/sign-in", data={"secret": second}).status_code == 303
    with web.store.transaction() as session:
        identity = credentials.identify(session, first, CredentialKind.TOKEN)
        assert identity is not None
        revocation.revoke_credential(session, identity.credential_id, ada.person_id)
        assert len(credentials.list_credentials(session, ada.person_id)) == 2
    assert browser.get("/account").status_code == 303
    assert other.get("/account").status_code == 200


def test_what_has_ended_counts_no_more(web: Web) -> None:
    ada = web.student()
    with web.store.transaction() as session:
        past = timedelta(seconds=-1)
        link = credentials.issue_credential(session, ada.person_id, CredentialKind.LINK, past)
        secret = credentials.issue_credential(session, ada.person_id, CredentialKind.SESSION, past)
        token = credentials.issue_credential(
            session, ada.person_id, CredentialKind.TOKEN, past, reach=Reach(scopes=frozenset({"read"}))
        )
        assert credentials.redeem_link(session, link) is None
        assert credentials.identify(session, secret, CredentialKind.SESSION) is None
        assert credentials.identify(session, token, CredentialKind.TOKEN) is None


def test_tries_to_sign_in_are_counted(web: Web) -> None:
    answers = [web.browser().post("/sign-in", data={"secret": "rml_wrong"}) for _ in range(40)]
    assert {answer.status_code for answer in answers} == {403, 429}
    refused = next(answer for answer in answers if answer.status_code == 429)
    assert int(refused.headers["retry-after"]) >= 1


def test_wrong_links_keep_nobody_out(web: Web) -> None:
    ada = web.student()
    browser = web.browser()
    answers = [browser.post("/sign-in", data={"secret": "rml_wrong"}).status_code for _ in range(40)]
    answers += [browser.get("/sign-in/rml_wrong").status_code for _ in range(3)]
    assert answers[-4:] == [429] * 4
    link = web.link(ada)
    assert browser.get(f"/sign-in/{link}").status_code == 200
    assert browser.post("/sign-in", data={"secret": link}).status_code == 303
    token = web.token(ada, "sign-in")["authorization"].removeprefix("Bearer ")
    assert web.browser().post("/sign-in", data={"secret": token}).status_code == 303


def test_an_instructor_of_two_courses_is_one_person_once_an_operator_joins_them(web: Web) -> None:
    with web.store.transaction() as session:
        first = membership.make_instructor(session, "one", Student("grace"))
        second = membership.make_instructor(session, "two", Student("grace"))
        other = membership.make_student(session, "two", Student("ada"))
    assert first.person_id != second.person_id
    assert other.role is Role.STUDENT
    web.join(first, second)
    page_text = web.browser(first).get("/").text
    assert 'href="/courses/1/batches">one</a>' in page_text
    assert 'href="/courses/2/batches">two</a>' in page_text


def test_a_student_does_not_become_an_instructor_under_their_own_sessions(web: Web) -> None:
    web.student("ada")
    with pytest.raises(UsageError, match="'ada' is a student of this course"):
        web.instructor("ada")


@pytest.mark.long
def test_the_commands_make_people_links_and_tokens(tmp_path: Path) -> None:
    added = robomark("user", "add", "grace", "--name", "Grace", "--operator", ROBOMARK_HOME=str(tmp_path))
    assert added.stdout.startswith("/sign-in/rml_")
    assert robomark("user", "link", "nobody", ROBOMARK_HOME=str(tmp_path)).returncode == 2
    refused = robomark("user", "token", "grace", "--scope", "all", ROBOMARK_HOME=str(tmp_path))
    assert refused.returncode == 2
    assert "expected one of read, submit, mark, manage" in refused.stderr
    token = robomark("user", "token", "grace", "--scope", "read", ROBOMARK_HOME=str(tmp_path)).stdout.strip()
    assert token.startswith("rmt_")
    listed = robomark("user", "list", ROBOMARK_HOME=str(tmp_path)).stdout
    assert "instructor, operator" in listed
    assert token not in listed
