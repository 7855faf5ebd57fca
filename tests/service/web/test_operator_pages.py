"""Operators' pages: the state of a service, and actions on failed jobs."""

from __future__ import annotations

from builders import grading_request
from service.store.batches.intake import accept_new_submissions
from service.store.queue import jobs
from service.store.queue.jobs import RetryPolicy
from service.store.states import JobState
from service.store.tables.submissions import Job
from web import Web, submit, words

AT_ONCE = RetryPolicy(backoff_seconds=0)
LOST = "the worker one fell silent while it graded; its log may tell why"


def lose(web: Web, *students: str, most: int) -> None:
    """Submit for these students, and let the worker of each fail once."""
    accept_new_submissions(web.store, "spring", [grading_request(each) for each in students], (), max_attempts=most)
    for _ in students:
        claim = jobs.claim_job(web.store, "one", 60)
        assert claim is not None
        jobs.fail_job(web.store, claim, LOST, AT_ONCE)


def test_attempts_that_were_lost_are_told_and_count_against_nobody(web: Web) -> None:
    root = web.browser(web.operator())
    assert "because of the system" not in words(root.get("/operator").text)
    lose(web, "ada", most=3)
    assert "1 grading attempt failed because of the system" in words(root.get("/operator").text)
    lose(web, "bob", most=3)
    page = words(root.get("/operator").text)
    assert "2 grading attempts failed because of the system" in page
    assert "No failed jobs." in page
    token = web.token(web.operator(), "read")
    document = web.browser().get("/api/v1/operator", headers=token).json()
    assert (document["host_faults"], document["dead"]) == (2, 0)


def test_what_could_not_be_graded_is_listed_with_its_reason_and_queued_again(web: Web) -> None:
    root = web.browser(web.operator())
    lose(web, "ada", "bob", most=1)
    page = words(root.get("/operator").text)
    assert page.count(f"Tried once, the last time: {LOST}") == 2
    assert submit(root, "/operator/retry").status_code == 303
    assert "Tried once" not in words(root.get("/operator").text)
    with web.store.reading() as session:
        assert {job.state for job in session.query(Job)} == {JobState.QUEUED}


def test_a_lane_says_what_waits_in_it(web: Web) -> None:
    root = web.browser(web.operator())
    accept_new_submissions(
        web.store, "spring", [grading_request(each) for each in ("ada", "bob", "cyd")], (), max_attempts=3
    )
    assert "batch: whole classes 3 0" in words(root.get("/operator").text)
    assert jobs.claim_job(web.store, "one", 60) is not None
    assert "batch: whole classes 2 1" in words(root.get("/operator").text)
