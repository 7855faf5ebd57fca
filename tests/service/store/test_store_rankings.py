"""An assignment's ranking, read across a graded batch."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import report_builders
from builders import echo, grading_request, prepared
from service.grading.grade import CriterionResult, Evidence, Measure
from service.store.batches import job_lines, rankings
from service.store.batches.intake import accept_batch
from service.store.engine import Store
from service.store.grades import overrides
from service.store.queue import jobs
from submissions.assignment.reader import find_assignment
from submissions.grading_request import GradingRequest


def graded(store: Store, requests: list[GradingRequest], laps: dict[str, tuple[float | None, ...]]) -> str:
    """Return a batch with these lap times, trial by trial; None for a lap that did not count."""
    batch = accept_batch(store, "class", requests, [], max_attempts=2).id
    for _ in requests:
        claim = jobs.claim_job(store, "worker", 60)
        assert claim is not None
        with store.reading() as session:
            student = job_lines.load_job_line(session, claim.job_id).student
        evidence = tuple(
            Evidence(0, lap is not None, "", measures=() if lap is None else (Measure("lap time", lap, "s"),))
            for lap in laps[student]
        )
        fast = CriterionResult("fast", "Drives it fast", Decimal(1), Decimal(5), "", evidence=evidence)
        grade = replace(report_builders.line_follower_grade(3), criteria=(fast,))
        jobs.finish_job(store, claim, prepared(grade), datetime.now(UTC))
    return batch


def test_a_batch_has_a_table_for_each_ranking(store: Store) -> None:
    circuit = find_assignment("fastest-lap-of-thruxton")
    laps: dict[str, tuple[float | None, ...]] = {
        "ada": (40.0, 42.0),
        "bob": (41.0, None),
        "cyd": (None,),
        "dan": (60.0,),
    }
    requests = [replace(grading_request(student), assignment=circuit) for student in laps]
    batch = graded(store, requests, laps)
    with store.reading() as session:
        (table,) = rankings.build_rank_tables(session, job_lines.load_job_lines(session, batch))
    assert (table.assignment, table.measure, table.unit) == ("fastest-lap-of-thruxton", "lap time", "s")
    assert table.texts == [
        ("1=", "ada", "41.00", "28.29 to 53.71", "2 of 2"),
        ("1=", "bob", "41.00", "", "1 of 2"),
        ("3", "dan", "60.00", "", "1 of 1"),
        ("", "cyd", "none", "", "0 of 1"),
    ]


def test_what_ranks_nothing_has_no_table(store: Store) -> None:
    batch = graded(store, [replace(grading_request("ada"), assignment=echo())], {"ada": (40.0,)})
    with store.reading() as session:
        assert rankings.build_rank_tables(session, job_lines.load_job_lines(session, batch)) == []


def test_who_is_excused_from_a_ranking_has_no_place_in_it(store: Store) -> None:
    circuit = find_assignment("fastest-lap-of-thruxton")
    laps: dict[str, tuple[float | None, ...]] = {"ada": (40.0,), "bob": (41.0,)}
    requests = [replace(grading_request(student), assignment=circuit) for student in laps]
    batch = graded(store, requests, laps)
    with store.transaction() as session:
        ada, _ = job_lines.load_job_lines(session, batch)
        overrides.excuse_criterion(session, ada.id, "fast", "was ill", "grace")
        (table,) = rankings.build_rank_tables(session, job_lines.load_job_lines(session, batch))
    assert [row[1] for row in table.texts] == ["bob"]
