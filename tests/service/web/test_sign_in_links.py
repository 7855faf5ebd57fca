"""Sign-in links for others: visible to their issuer while they are valid, and recorded in the activity log."""

from __future__ import annotations

import csv
import io
import re

from sqlalchemy import select
from starlette.testclient import TestClient

from service.store import audit
from service.store.people import membership
from service.store.tables.people import Credential
from web import Web, submit

PEOPLE = "/courses/1/people"
_SECRET = re.compile(r"/sign-in/(rml_[\w-]+)")


def signs_in(web: Web, secret: str) -> bool:
    return web.browser().post("/sign-in", data={"secret": secret}).status_code == 303


def shown_at(browser: TestClient, where: str) -> str | None:
    match = _SECRET.search(browser.get(where).text)
    return None if match is None else match[1]


def test_a_link_is_shown_again_until_it_is_used(web: Web, grace: TestClient) -> None:
    own = f"{PEOPLE}/{web.student().enrolment_id}"
    where = submit(grace, f"{own}/link").headers["location"]
    secret = shown_at(grace, where)
    assert secret
    assert shown_at(grace, where) == secret
    assert shown_at(grace, own) is None
    assert shown_at(web.browser(web.instructor("linus")), where) is None
    assert grace.get(f"{own}/link").headers["location"] == own
    with web.store.reading() as session:
        assert secret not in [kept for row in session.scalars(select(Credential)) for kept in (row.sha256, row.name)]
    assert signs_in(web, secret)
    assert shown_at(grace, where) is None
    assert "was used or has expired" in grace.get(where).text


def test_a_newer_link_takes_the_place_of_one_that_was_not_used(web: Web, grace: TestClient) -> None:
    own = f"{PEOPLE}/{web.student().enrolment_id}"
    first, second = (submit(grace, f"{own}/link").headers["location"] for _ in range(2))
    assert shown_at(grace, first) is None
    secret = shown_at(grace, second)
    assert secret
    assert signs_in(web, secret)


def test_an_address_shows_no_link_of_somebody_else(web: Web, grace: TestClient) -> None:
    ada, bob = web.student("ada"), web.student("bob")
    word = submit(grace, f"{PEOPLE}/{ada.enrolment_id}/link").headers["location"].partition("?")[2]
    assert shown_at(grace, f"{PEOPLE}/{bob.enrolment_id}?{word}") is None
    for other in ("link=", "link=x", "link=%00", f"link={'x' * 64}"):
        assert shown_at(grace, f"{PEOPLE}/{ada.enrolment_id}?{other}") is None


def test_a_whole_course_has_its_links_in_one_table(web: Web, grace: TestClient) -> None:
    members = {who: web.student(who) for who in ("ada", "bob", "=cmd()")}
    elsewhere = web.student("dan")
    with web.store.transaction() as session:
        membership.make_operator(session, elsewhere.person_id)
    before = web.link(members["ada"])
    answer = submit(grace, f"{PEOPLE}/links", {"days": "3"})
    assert answer.headers["content-disposition"].startswith("attachment")
    rows = {row["id"]: row for row in csv.DictReader(io.StringIO(answer.content.decode("utf-8-sig")))}
    assert set(rows) == {"ada", "bob", "'=cmd()", "dan"}
    assert (rows["dan"]["link"], rows["dan"]["expires"]) == ("", "")
    assert "in other courses" in rows["dan"]["reason"]
    assert not signs_in(web, before)
    for who in ("ada", "bob"):
        match = _SECRET.search(rows[who]["link"])
        assert match
        assert signs_in(web, match[1])
        assert not signs_in(web, match[1])
    with web.store.reading() as session:
        (entry,) = audit.load_entries(session, "course", "1")
    assert (entry.action, entry.actor, entry.detail) == ("links", "Grace (person 1)", {"students": 3, "days": 3})
    assert submit(grace, f"{PEOPLE}/links", {"days": "400"}).status_code == 422


def test_programs_have_the_same_links(web: Web) -> None:
    ada, token = web.student(), web.token(web.instructor(), "manage")
    path = f"/api/v1{PEOPLE}"
    one = web.browser().post(f"{path}/{ada.enrolment_id}/link", headers=token).json()["path"]
    (all_,) = web.browser().post(f"{path}/links", headers=token).json()["links"]
    assert all_["id"] == "ada"
    assert [signs_in(web, each.rpartition("/")[2]) for each in (one, all_["path"])] == [False, True]


def test_a_new_instructors_link_is_shown_to_the_operator(web: Web) -> None:
    root = web.browser(web.operator())
    where = submit(root, "/operator/courses", {"course": "TM129", "who": "linus"}).headers["location"]
    assert shown_at(web.browser(web.operator("other")), where) is None
    secret = shown_at(root, where)
    assert secret
    assert signs_in(web, secret)
