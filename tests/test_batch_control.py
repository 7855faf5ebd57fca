"""``robomark batch submit`` of a roster, again, ``pause``, ``resume``, ``cancel``, ``retry`` and ``export``."""

from __future__ import annotations

import json
import re
import shutil
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rich.console import Console
from sqlalchemy import select

from builders import hand_in, settings_in
from service.queue.celery_app import make_celery
from service.queue.embedded import EmbeddedServices
from service.queue.nudges import Nudger
from service.store import batch_control
from service.store.engine import Store, open_store
from service.store.intake import accept_batch
from service.store.models import Job, JobState, Lane
from service.waiting import Waiting
from submissions.example_folder import examples
from test_batch_commands import Ended, robomark

SPIN = "while True:\n    pass\n"


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Ended]:
    """A home after a roster of two good rows and a bad one; the roster; what the command said."""
    folder = tmp_path_factory.mktemp("class")
    for name in ("reference", "flawed"):
        shutil.copytree(examples("echo-responder") / name, folder / name)
    roster = folder / "roster.csv"
    roster.write_text("student;file\n=1/2 🤖;reference\nbob;flawed\neve;nowhere.zip\n", encoding="utf-8-sig")
    home = tmp_path_factory.mktemp("home")
    return home, roster, robomark(home, "batch", "submit", roster, "-a", "echo-responder", "--wait")


def _batch(ended: Ended) -> str:
    found = re.search(r"batch (\w{12}): \d+ queued", ended.out)
    assert found is not None, ended
    return found[1]


def test_a_roster_is_graded_and_the_same_again_changes_nothing(graded: tuple[Path, Path, Ended]) -> None:
    home, roster, ended = graded
    assert ended.status == 2
    assert re.search(r"^line 4: eve +nowhere\.zip: does not exist", ended.out, re.MULTILINE)
    marked = re.search(r"^bob +echo-responder .* (\w{12})$", ended.out, re.MULTILINE)
    assert marked is not None, ended
    again = robomark(home, "batch", "submit", roster, "-a", "echo-responder", "--wait")
    assert f"already handed in as {marked[1]}" in again.out
    assert "nothing new" in again.out
    assert marked[0] in again.out
    assert len(robomark(home, "batch", "list").out.strip().splitlines()) == 2


@pytest.mark.parametrize(("form", "suffix"), [("gradescope", ".json"), ("junit", ".xml")])
def test_a_file_for_each_hand_in(graded: tuple[Path, Path, Ended], tmp_path: Path, form: str, suffix: str) -> None:
    home, _, ended = graded
    out = tmp_path / "out" / form
    exported = robomark(home, "batch", "export", _batch(ended), "--format", form, "--out", out)
    assert (exported.status, exported.out.split()[0]) == (0, "2")
    assert sorted(path.name for path in out.iterdir()) == [f"1-2{suffix}", f"bob{suffix}"]
    text = (out / f"1-2{suffix}").read_text()
    if form == "junit":
        assert ElementTree.fromstring(text).find("testsuite") is not None
    else:
        assert json.loads(text)["score"] == 10
    refused = robomark(home, "batch", "export", _batch(ended), "--format", form)
    assert (refused.status, "--out" in refused.err) == (2, True)


def test_each_change_is_one_sentence(graded: tuple[Path, Path, Ended], tmp_path: Path) -> None:
    _, roster, _ = graded
    home = tmp_path / "home"
    batch = _batch(robomark(home, "batch", "submit", roster, "-a", "echo-responder"))
    for words, status, sentence in [
        (("pause", batch), 0, f"batch {batch} is paused: 2 waiting, 0 graded to their end"),
        (("pause", batch[:6]), 0, f"batch {batch} was paused already"),
        (("status", batch), 0, "roster.csv: paused: 2 queued"),
        (("resume", batch), 0, f"batch {batch} goes on: 2 waiting, 0 being graded"),
        (("retry", batch), 0, f"batch {batch}: nothing changed, no hand-in is dead"),
        (("retry", "--all"), 0, "all batches: nothing changed"),
        (("cancel", batch), 0, f"batch {batch} is cancelled: 2 not begun, 0 stopped"),
        (("cancel", batch), 0, "nothing changed"),
        (("list",), 0, "cancelled: 2 cancelled"),
        (("resume", batch), 2, "was cancelled; hand it in again"),
        (("retry",), 2, "name one batch, or --all"),
        (("pause", "nosuchbatch"), 2, "there is no batch"),
    ]:
        ended = robomark(home, "batch", *words)
        assert (ended.status, sentence in ended.out + ended.err) == (status, True), (words, ended)


def test_a_worker_honours_pause_and_cancel(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=1)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        nudger = Nudger(make_celery(services.settings), store, services.settings)

        def grade(batch: str, count: int) -> None:
            nudger.grade(Lane.BATCH, count)
            Waiting(store, nudger, batch, Console(quiet=True), services.ensure).for_marks()

        paused = accept_batch(store, "paused", [hand_in("ada")], [], max_attempts=2).id
        batch_control.pause(store, paused)
        other = accept_batch(store, "other", [hand_in("bob")], [], max_attempts=2).id
        grade(other, 2)
        assert _states(store, paused) == [JobState.QUEUED]
        batch_control.resume(store, paused)
        grade(paused, 0)
        assert _states(store, paused) == [JobState.DONE]

        spinning = accept_batch(store, "spinning", [hand_in(name, SPIN) for name in "xyz"], [], max_attempts=2).id
        nudger.grade(Lane.BATCH, 3)
        until = time.monotonic() + 60
        while JobState.RUNNING not in _states(store, spinning):
            assert time.monotonic() < until
            time.sleep(0.05)
        assert batch_control.cancel(store, spinning) == batch_control.Controlled(True, 2, 1)
        after = accept_batch(store, "after", [hand_in("eve")], [], max_attempts=2).id
        grade(after, 1)
        assert _states(store, spinning) == [JobState.CANCELLED] * 3


def _states(store: Store, batch: str) -> list[JobState]:
    with store.reading() as session:
        return list(session.scalars(select(Job.state).where(Job.batch_id == batch)))
