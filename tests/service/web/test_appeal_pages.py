"""Lists of appeals have pages, so that one student's many appeals do not hide others."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

import pytest

from builders import grading_request
from report_builders import faulty_grade
from service.store.batches import intake
from service.store.tables.grades import Appeal
from web import COURSE, Web, grade_all, words

_MANY = 130


@pytest.fixture
def web_of_many(web: Web) -> Web:
    """Create many open and answered appeals by Ada, and then one of each by Bob."""
    intake.accept_batch(
        web.store, "b", [grading_request("ada"), grading_request("bob")], (), course=COURSE, max_attempts=1
    )
    grade_all(web, faulty_grade())
    start = datetime(2026, 1, 1, tzinfo=UTC)
    with web.store.transaction() as session:
        for number in range(_MANY):
            answered = start + timedelta(days=2, seconds=-(number // 2))  # two at a time
            session.add(Appeal(submission_id=1, text=f"open {number}.", asked_at=start + timedelta(seconds=number)))
            session.add(
                Appeal(
                    submission_id=1, text="?", asked_at=start, answer=f"done {number}.", actor="g", answered_at=answered
                )
            )
        session.add(Appeal(submission_id=2, text="Bob asks.", asked_at=start + timedelta(days=1)))
        session.add(Appeal(submission_id=2, text="?", asked_at=start, answer="To Bob.", actor="g", answered_at=start))
    return web


def test_the_pages_lead_to_every_appeal(web_of_many: Web) -> None:
    browser = web_of_many.browser(web_of_many.instructor())
    for link, last, each in (("after", "Bob asks.", "open"), ("answered_after", "To Bob.", "done")):
        path, seen, pages = "/courses/1/appeals", list[str](), 0
        while True:
            response = browser.get(path)
            assert response.status_code == 200
            seen += re.findall(rf"{each} (\d+)\.", words(response.text))
            pages += 1
            match = re.search(rf'href="(/courses/1/appeals\?{link}=[^"]+)"', response.text)
            if match is None:
                break
            path = match[1]
        assert last in words(response.text)
        assert sorted(map(int, seen)) == list(range(_MANY))
        assert pages == 3


@pytest.mark.parametrize("answered", ["false", "true"])
def test_programs_are_led_to_every_appeal(web_of_many: Web, answered: str) -> None:
    token = web_of_many.token(web_of_many.instructor(), "read")
    client, appeal_ids, after = web_of_many.browser(), list[int](), ""
    while True:
        path = f"/api/v1/courses/1/appeals?answered={answered}&limit=40&after={after}"
        document = client.get(path, headers=token).json()
        appeal_ids += [each["id"] for each in document["items"]]
        if document["next"] is None:
            break
        after = document["next"]
    assert len(appeal_ids) == len(set(appeal_ids)) == _MANY + 1


@pytest.mark.parametrize("place", ["x", "2026-01-01", "2026-01-01 x", "9999-12-31T23:59:59-23:59 1", " "])
def test_a_place_that_is_none_is_the_first(web: Web, place: str) -> None:
    browser = web.browser(web.instructor())
    assert browser.get("/courses/1/appeals", params={"answered_after": place}).status_code == 200
