"""``robomark up`` and ``serve``: the whole service starts, reports its state, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import re
import signal
import stat
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from prometheus_client.parser import text_string_to_metric_families
from sqlalchemy import func, select

from benchmarks.harness.process_tree import find_descendants, read_command_line
from builders import accept_one, grading_request, patient_echo, settings_in
from processes import COMMAND, alive, robomark, until
from service.command_line import main
from service.queue.broker import is_broker_responding
from service.queue.live_workers import is_worker_running
from service.settings import Settings
from service.store import phases
from service.store.batches.intake import accept_batch
from service.store.engine import Store, open_store
from service.store.states import JobState, PlotState
from service.store.tables.submissions import Job
from service.web.listening_sockets import listen
from sim.errors import UsageError

SPIN = "print('begun')\nwhile True:\n    pass\n"


def _environment(settings: Settings) -> dict[str, str]:
    return settings.to_environment()


def _address(up: subprocess.Popen[str]) -> str:
    return _first_words(up)[0]


def _first_words(up: subprocess.Popen[str]) -> tuple[str, str]:
    """Return the address that the service prints first, and its complete output."""
    assert up.stdout is not None
    first = up.stdout.readline()
    match = re.search(r"http://[\w.:]+", first)
    assert match is not None, first + (up.stderr.read() if up.stderr and up.poll() is not None else "")
    return match[0], first


def _ready(up: subprocess.Popen[str]) -> str:
    address, first = _first_words(up)
    # Output that goes to no terminal may go to a log that others read.
    assert "rml_" not in first
    document = Path(json.loads(first)["message"].partition("sign in with the link in ")[2])
    assert stat.S_IMODE(document.stat().st_mode) == 0o600
    link = document.read_text().strip()
    assert re.fullmatch(re.escape(address) + r"/sign-in/rml_[\w-]+", link)
    until(lambda: "This link signs you in as" in _get(link)[1])
    assert up.stdout is not None
    ready = json.loads(up.stdout.readline())
    assert ready["event"] == "up.ready"
    assert ready["message"].startswith("ready: ")
    return address


def _get(address: str) -> tuple[int, str]:
    try:
        with urlopen(address, timeout=30) as answer:
            return answer.status, answer.read().decode()
    except HTTPError as error:
        return error.code, error.read().decode()


def _metrics(address: str) -> dict[tuple[str, ...], float]:
    status, text = _get(f"{address}/metrics")
    assert status == 200
    return {
        (sample.name, *(value for _, value in sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def _jobs(store: Store, state: JobState) -> int:
    with store.reading() as session:
        return session.scalar(select(func.count()).select_from(Job).where(Job.state == state)) or 0


def test_all_of_it_comes_up_grades_tells_and_ends(tmp_path: Path) -> None:
    settings = settings_in(tmp_path / "a home", concurrency=1)
    with open_store(settings) as store, robomark("up", "--port", "0", **_environment(settings)) as up:
        address = _ready(up)
        assert _get(f"{address}/health/live") == (200, '{"live":true}')
        until(lambda: _get(f"{address}/health/ready")[0] == 200)
        quick = accept_one(store, "quick").job_id

        def plotted() -> Job | None:
            with store.reading() as session:
                job = session.get_one(Job, quick)
                return job if job.plots is PlotState.DONE else None

        job = until(plotted)
        assert job is not None
        assert tuple(job.phases) == phases.NAMES
        assert sorted(job.phases.values()) == list(job.phases.values())
        spinning = accept_batch(
            store, "spinning", [grading_request("spinner", SPIN), grading_request("next", SPIN)], [], max_attempts=3
        )
        until(lambda: _jobs(store, JobState.RUNNING))
        metrics_text = _metrics(address)
        assert metrics_text["robomark_jobs_open", "batch", "running"] == 1
        assert metrics_text["robomark_queue_depth", "batch"] == 1
        assert metrics_text["robomark_queue_oldest_seconds", "batch"] > 0
        assert metrics_text["robomark_jobs_ended_total", "interactive", "done"] == 1
        assert metrics_text["robomark_verdicts_total", "finished"] == 1
        assert metrics_text["robomark_phase_seconds", "trials", "0.95"] > 0
        assert metrics_text["robomark_workers",] == 1

        # A second service reports where the first one runs, and changes nothing.
        second = subprocess.run(
            [*COMMAND, "up"], env=os.environ | _environment(settings), capture_output=True, text=True
        )
        assert (second.returncode, second.stdout) == (2, "")
        assert f"process {up.pid}, {address}" in second.stderr

        below = find_descendants(up.pid)
        up.send_signal(signal.SIGINT)
        out, err = up.communicate(timeout=150)
        assert (up.returncode, err) == (0, "")
        # Running jobs were finished within the time allowed, or requeued.
        assert re.fullmatch(r"stopped; running jobs returned to the queue: [01]", json.loads(out)["message"])
        assert not any(map(alive, below))
        assert _jobs(store, JobState.RUNNING) == 0
        with store.reading() as session:
            left = [session.get_one(Job, each.job_id) for each in spinning.jobs]
            assert {(job.state, job.attempt) for job in left} <= {(JobState.QUEUED, 0), (JobState.DONE, 1)}
    locks = {"broker.lock", "up.lock", "worker.lock", "gate.lock", "slots.lock", "right-answer.lock"}
    left_there = {path.name for path in (settings.home / "run").iterdir()}
    # The next start reuses the result of this self-test.
    assert {name for name in left_there if not name.startswith("right-answer-")} <= locks


@pytest.mark.long
def test_what_ends_is_started_again_and_a_kill_leaves_nothing(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=1, lease_seconds=300)
    run = settings.home / "run"
    for name in ("valkey.sock", "worker.lock", "up.lock", "broker.lock"):
        # Files in this folder do not prevent the start.
        (run / name / "rubbish").mkdir(parents=True)
    (run / "somebody.alive").write_text("nonsense")
    with open_store(settings) as store:
        with robomark("up", "--port", "0", **_environment(settings)) as up:
            address = _ready(up)
            first = find_descendants(up.pid)
            for pid in first:
                if any(word in read_command_line(pid) for word in ("valkey", "service.queue.worker", "web.server")):
                    os.kill(pid, signal.SIGKILL)
            until(lambda: not any(map(alive, first)))
            accept_batch(store, "spinning", [grading_request("spinner", SPIN, patient_echo())], [], max_attempts=3)
            until(lambda: _jobs(store, JobState.RUNNING))
            assert _get(f"{address}/health/live")[0] == 200
            below = find_descendants(up.pid)
            assert len(below) >= 6
            up.kill()
            up.wait()
            until(lambda: not any(map(alive, below)))
        assert not is_broker_responding(settings)
        assert not is_worker_running(settings)
        assert _jobs(store, JobState.RUNNING) == 1
        # The next worker need not wait for the lease of a worker that is known to have ended.
        with robomark("up", "--no-serve", **_environment(settings)) as up:
            until(lambda: _jobs(store, JobState.DONE))
            up.send_signal(signal.SIGTERM)
            assert up.wait(timeout=60) == 0
        with store.reading() as session:
            assert [job.attempt for job in session.scalars(select(Job))] == [1]


@pytest.mark.long
def test_serve_says_what_is_not_well(tmp_path: Path) -> None:
    settings = settings_in(tmp_path)
    with robomark("serve", "--port", "0", **_environment(settings)) as server:
        address = _address(server)
        status, text = until(lambda: _get(f"{address}/health/ready"))
        assert status == 503
        checks = json.loads(text)["checks"]
        assert {name: check["well"] for name, check in checks.items()} == {
            "database": True,
            "broker": False,
            "workers": False,
            "queue": True,
            "sandbox": False,
            "release": True,
        }
        assert _metrics(address)["robomark_workers",] == 0
        host, _, port = address.removeprefix("http://").partition(":")
        with pytest.raises(UsageError, match="Address already in use"):
            listen(host, int(port))
        settings.home.joinpath("robomark.db").unlink()
        assert _get(f"{address}/metrics")[0] == 503
        assert _get(f"{address}/health/ready")[0] == 503
        assert _get(f"{address}/health/live")[0] == 200
        server.send_signal(signal.SIGTERM)
        assert server.wait(timeout=60) == 0


@pytest.mark.parametrize(
    "arguments", [("up", "--workers", "0"), ("serve", "--port", "70000"), ("serve", "--host", "a b")]
)
def test_what_cannot_be_served_is_said(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROBOMARK_HOME", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["robomark", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    captured = capsys.readouterr()
    assert (ended.value.code, captured.out, captured.err.count("\n")) == (2, "", 1)
