"""``robomark batch submit`` of a roster, repeated, then ``pause``, ``resume``, ``cancel``, ``retry`` and ``export``."""

from __future__ import annotations

import json
import re
import shutil
import time
from decimal import Decimal
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rich.console import Console
from sqlalchemy import select, update

import acting
from batch_command import Ended, robomark
from builders import asked_already, grading_request, settings_in
from service.commands.batch.batch_waiter import BatchWaiter
from service.operations.batches import BatchControlResult
from service.queue.celery_app import make_celery
from service.queue.embedded_services import EmbeddedServices
from service.queue.notifier import Notifier
from service.reports.formats import FORMATS
from service.reports.output_files import build_file_stem
from service.store.batches.intake import accept_batch
from service.store.engine import Store, open_store
from service.store.states import JobQueue, JobState
from service.store.tables.grades import CriterionResultRow, TrialRow
from service.store.tables.submissions import Job
from submissions.assignment.examples import locate_examples

SPIN = "while True:\n    pass\n"


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Ended]:
    """Return a home after a roster of two good rows and one of each bad kind, the roster, and the command's output."""
    folder = tmp_path_factory.mktemp("class")
    for name in ("reference", "flawed"):
        shutil.copytree(locate_examples("echo-responder") / name, folder / name)
    roster = folder / "roster.csv"
    (folder / "broken.zip").write_bytes(b"PK\3\4 and no more")
    rows = ["student;file;assignment", "=1/2 🤖;reference;", "bob;flawed;", "eve;nowhere.zip;"]
    rows += ["bob;flawed;", "mia;broken.zip;", "kim;reference;no-such-thing"]
    roster.write_text("\n".join(rows) + "\n", encoding="utf-8-sig")
    home = asked_already(tmp_path_factory.mktemp("home"))
    return home, roster, robomark(home, "batch", "submit", roster, "-a", "echo-responder", "--wait")


def _batch(ended: Ended) -> str:
    match = re.search(r"batch (\w{12}): \d+ queued", ended.out)
    assert match is not None, ended
    return match[1]


@pytest.mark.long
def test_a_roster_is_graded_and_the_same_again_changes_nothing(graded: tuple[Path, Path, Ended]) -> None:
    home, roster, ended = graded
    assert ended.status == 2
    for row in (
        r"line 4: eve +nowhere\.zip: does not exist",
        r"line 5: bob +line 3: bob is already this student's submission",
        r"line 6: mia +broken\.zip: ",
        r"line 7: kim +.*no-such-thing",
        r"=1/2 🤖 +echo-responder +10 / 10",
    ):
        assert re.search(rf"^{row}", ended.out, re.MULTILINE), row
    marked = re.search(r"^bob +echo-responder .* (\w{12})$", ended.out, re.MULTILINE)
    assert marked is not None, ended
    again = robomark(home, "batch", "submit", roster, "-a", "echo-responder", "--wait")
    assert f"already submitted as {marked[1]}" in again.out
    assert "no new submissions" in again.out
    assert marked[0] in again.out
    assert len(robomark(home, "batch", "list").out.strip().splitlines()) == 2


@pytest.mark.long
@pytest.mark.parametrize("form", [name for name, form in FORMATS.items() if form.document is not None])
def test_a_file_for_each_submission(graded: tuple[Path, Path, Ended], tmp_path: Path, form: str) -> None:
    home, _, ended = graded
    out = tmp_path / "out" / form
    exported = robomark(home, "batch", "export", _batch(ended), "--format", form, "--output", out)
    refused = ["line 4: eve", "line 5: bob", "line 6: mia", "line 7: kim"] if FORMATS[form].refusal else []
    assert (exported.status, exported.out.split()[0]) == (0, str(2 + len(refused)))
    odd = f"{build_file_stem('=1/2 🤖')}{FORMATS[form].suffix}"
    assert odd.startswith("1-2~")
    names = {odd, f"bob{FORMATS[form].suffix}"}
    names |= {f"{build_file_stem(source, 'refused')}{FORMATS[form].suffix}" for source in refused}
    assert {path.name for path in out.iterdir()} == names
    text = (out / odd).read_text()
    if form == "junit":
        assert ElementTree.fromstring(text).find("testsuite") is not None
    if form == "gradescope":
        assert json.loads(text)["score"] == 10
    on_screen = robomark(home, "batch", "export", _batch(ended), "--format", form)
    assert on_screen.status == (2 if FORMATS[form].table is None else 0)
    assert ("--output" in on_screen.err) == (FORMATS[form].table is None)


@pytest.mark.long
def test_each_change_is_one_sentence(graded: tuple[Path, Path, Ended], tmp_path: Path) -> None:
    _, roster, _ = graded
    home = tmp_path / "home"
    batch = _batch(robomark(home, "batch", "submit", roster, "-a", "echo-responder"))
    for words, status, sentence in [
        (("pause", batch), 0, f"batch {batch} is paused: 2 queued, 0 still running"),
        (("pause", batch[:6]), 0, f"batch {batch} was paused already"),
        (("status", batch), 0, "roster.csv: paused: 2 queued"),
        (("resume", batch), 0, f"batch {batch} is resumed: 2 queued, 0 running"),
        (("retry", batch), 0, f"batch {batch}: nothing changed, there are no failed jobs"),
        (("retry", "--all"), 0, "all batches: nothing changed"),
        (("cancel", batch), 0, f"batch {batch} is cancelled: 2 queued jobs cancelled, 0 running jobs stopped"),
        (("cancel", batch), 0, "nothing changed"),
        (("list",), 0, "cancelled: 2 cancelled"),
        (("resume", batch), 2, "was cancelled; submit it again"),
        (("retry",), 2, "name one batch, or use --all"),
        (("pause", "nosuchbatch"), 2, "there is no batch"),
    ]:
        ended = robomark(home, "batch", *words)
        assert (ended.status, sentence in ended.out + ended.err) == (status, True), (words, ended)


@pytest.mark.long
def test_a_worker_honours_pause_and_cancel(tmp_path: Path) -> None:
    settings = settings_in(asked_already(tmp_path), concurrency=1)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        notifier = Notifier(make_celery(services.settings), store, services.settings)

        def grade(batch: str, count: int) -> None:
            notifier.grade(JobQueue.BATCH, count)
            BatchWaiter(
                acting.service_on(store), acting.machine(), notifier, batch, Console(quiet=True), services.ensure
            ).wait_for_marks()

        paused = accept_batch(store, "paused", [grading_request("ada")], [], max_attempts=2).id
        acting.pause(store, paused)
        other = accept_batch(store, "other", [grading_request("bob")], [], max_attempts=2).id
        grade(other, 2)
        assert _states(store, paused) == [JobState.QUEUED]
        acting.resume(store, paused)
        grade(paused, 0)
        assert _states(store, paused) == [JobState.DONE]

        spinning = accept_batch(
            store, "spinning", [grading_request(name, SPIN) for name in "xyz"], [], max_attempts=2
        ).id
        notifier.grade(JobQueue.BATCH, 3)
        until = time.monotonic() + 60
        while JobState.RUNNING not in _states(store, spinning):
            assert time.monotonic() < until
            time.sleep(0.05)
        assert acting.cancel(store, spinning) == BatchControlResult(True, 2, 1)
        after = accept_batch(store, "after", [grading_request("eve")], [], max_attempts=2).id
        grade(after, 1)
        assert _states(store, spinning) == [JobState.CANCELLED] * 3


def _states(store: Store, batch: str) -> list[JobState]:
    with store.reading() as session:
        return list(session.scalars(select(Job.state).where(Job.batch_id == batch)))


@pytest.mark.long
def test_a_changed_assignment_is_regraded_shown_and_published_when_told(
    graded: tuple[Path, Path, Ended], tmp_path: Path
) -> None:
    home, _, ended = graded
    batch = _batch(ended)
    changed = tmp_path / "echo-responder"
    shutil.copytree(locate_examples("echo-responder").parent, changed, ignore=shutil.ignore_patterns("examples"))
    text = (changed / "assignment.toml").read_text()
    (changed / "assignment.toml").write_text(text.replace("marks = 4", "marks = 6"))
    regraded = robomark(home, "batch", "regrade", batch, "-a", changed, "--wait")
    assert regraded.status == 0, regraded
    assert re.search(r"^=1/2 🤖 +10 / 10 +12 / 12 .*: 4 / 4 to 6 / 6 +criteria changed", regraded.out, re.MULTILINE)
    assert "share of marks: 0 higher, 1 lower, 1 the same" in regraded.out
    again = re.search(r"batch (\w{12}): 2 queued for regrading", regraded.out)
    assert again is not None

    kept = robomark(home, "batch", "export", batch)
    assert "2 regrades are not published" in kept.err
    assert ",10,10," in kept.out
    withheld = robomark(home, "batch", "export", batch, "--published").out
    assert (withheld.count("not published"), ",10,10," in withheld) == (2, False)
    assert "2 grades published, 2 of them regrades" in robomark(home, "batch", "publish", batch[:8]).out
    assert ",12,12," in robomark(home, "batch", "export", batch, "--published").out

    status = robomark(home, "batch", "status", batch)
    assert re.search(r"^=1/2 🤖 .* 12 / 12 .*published", status.out, re.MULTILINE)
    assert re.search(r"\w+@\S+ +publish +published 2, replaced 2", status.out)
    assert "2 new grades are current" in robomark(home, "batch", "status", again[1]).out
    grade = re.search(r"^bob .* (\w{12})$", status.out, re.MULTILINE)
    assert grade is not None
    verified = robomark(home, "verify", grade[1])
    assert (verified.status, "matches its regrade" in verified.out) == (0, True)
    with open_store(settings_in(home)) as store, store.transaction() as session:
        session.execute(update(TrialRow).where(TrialRow.job_id == grade[1]).values(sha256="0" * 64))
        session.execute(
            update(CriterionResultRow).where(CriterionResultRow.job_id == grade[1]).values(marks=Decimal(0))
        )
    doubted = robomark(home, "verify", grade[1])
    assert (doubted.status, "does not match its regrade" in doubted.err) == (3, True)


@pytest.mark.long
def test_a_policy_and_an_extension_are_said_back(tmp_path: Path) -> None:
    assert "no policy" in robomark(tmp_path, "course", "policy").out
    set_ = robomark(tmp_path, "course", "policy", "--due", "2026-11-30", "--attempts", "2", "--late-days", "1")
    assert re.search(r"^all others +2026-11-30 23:59 +1 +2", set_.out, re.MULTILINE)
    assert robomark(tmp_path, "course", "policy").out == set_.out
    (tmp_path / "people.csv").write_text("name,id\nAda Lovelace,ada\n")
    assert robomark(tmp_path, "course", "enrol", tmp_path / "people.csv").out == "1 student is in the course\n"
    extended = robomark(tmp_path, "course", "extend", "ada", "-a", "json-queue", "--due", "2026-12-02T12:00")
    assert extended.out == "ada: json-queue may be submitted until 2026-12-02 12:00\n"
    for words, expected in [
        (("policy", "--due", "soon"), "expected a date"),
        (("extend", "ada"), "later deadline, additional attempts"),
        (("policy", "--attempts", "0"), "greater than or equal to 1"),
        (("extend", "adda", "--more-attempts", "1"), 'did you mean "ada"?'),
        (("extend", "ada", "-a", "json-que", "--more-attempts", "1"), 'did you mean "json-queue"?'),
        (("policy", "-a", "jsonqueue", "--attempts", "1"), 'did you mean "json-queue"?'),
    ]:
        refused = robomark(tmp_path, "course", *words)
        assert (refused.status, expected in refused.err) == (2, True), (words, refused)
