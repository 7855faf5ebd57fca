"""``robomark batch luck``: for staff, the share of chance in the marks of a batch."""

from __future__ import annotations

import json
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from builders import opened, prepared, settings_in
from chance import chance_assignment, chance_submission
from naming import is_named
from service.commands.batch import luck_report
from service.commands.batch.luck import luck
from service.commands.output import set_json_output
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.store.batches import stored_requests
from service.store.batches.intake import accept_batch
from service.store.queue import jobs
from submissions.grading_request import GradingRequest
from submissions.seeds import Secret

#: With a fixed secret, the draws are the same in each run of the tests.
SECRET = Secret("the secret of the luck tests, fixed")


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch, runner: TrialRunner) -> None:
    """Let the command use the secret, and the processes of this session."""
    monkeypatch.setenv("ROBOMARK_SECRET", SECRET.text)
    monkeypatch.setattr(luck_report, "TrialRunner", lambda: nullcontext(runner))


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory, runner: TrialRunner) -> tuple[Path, str]:
    """Return a home with three graded submissions, one of which was graded with another secret."""
    home = tmp_path_factory.mktemp("home")
    submissions = [chance_submission(each, guesses=each == "ada") for each in ("ada", "bob", "cyd")]
    requests = [GradingRequest(each, chance_assignment(), f"{each.student}.zip") for each in submissions]
    with opened(settings_in(home, secret=SECRET)) as store:
        batch = accept_batch(store, "class", requests, [], max_attempts=2).id
        for _ in requests:
            claim = jobs.claim_job(store, "worker", 60)
            assert claim is not None
            with store.reading() as session:
                request = stored_requests.load_grading_request(session, claim.job_id)
            result = grade(request.submission, request.assignment, secret=SECRET, runner=runner)
            if request.submission.student == "cyd":
                result = replace(result, secret_sha256="0" * 64)
            jobs.finish_job(store, claim, prepared(result), datetime.now(UTC))
    return home, batch


def test_the_report_names_the_stream_and_what_was_left_out(
    graded: tuple[Path, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    home, batch = graded
    monkeypatch.setenv("ROBOMARK_HOME", str(home))
    luck(batch, draws=2)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "chance: 2 of 3 graded submissions, 4 other draws of each random stream in total"
    assert lines[1].split()[:3] == ["criterion", "marks", "deviation"]
    says = next(line for line in lines if line.startswith("Says it"))
    assert "100%" in says
    assert not is_named("ada", "\n".join(lines)), lines
    assert lines[-1].endswith("left out of 3 submissions: 1 that cannot be run again here")


def test_the_document_has_the_same_figures(
    graded: tuple[Path, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    home, batch = graded
    monkeypatch.setenv("ROBOMARK_HOME", str(home))
    set_json_output(True)
    try:
        luck(batch, submissions=1, draws=1)
    finally:
        set_json_output(False)
    document = json.loads(capsys.readouterr().out)
    (assignment,) = document["assignments"]
    assert assignment["graded"] == 3
    assert assignment["luck"]["submissions"] + assignment["luck"]["unrepeatable"] == 1
