"""The secret of an installation: created once, kept with the database, and never shown, least to student code."""

from __future__ import annotations

import json
import re
import shutil
import sqlite3
from dataclasses import replace
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import update

from battery import scrambled
from command import FORKING, robomark
from first_release import lay_first_release
from responders.source_file import SourceFile
from service import home_secret
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.home_secret import load_home_secret
from service.settings import Settings, load_settings
from service.store.engine import open_store
from service.store.installation import load_secret
from service.store.tables.installation import Installation
from service.store.tables.submissions import Job
from sim.errors import HostError, UsageError
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.seeds import Secret
from submissions.submission import Submission

SECRET = "a-secret-of-32-characters-9c41e7"
ECHO = locate_examples("echo-responder") / "reference"


def _put_secret(settings: Settings, secrets_queue: Queue[str]) -> None:
    with open_store(settings) as store:
        secrets_queue.put(load_secret(store).text)


def test_all_who_start_at_once_agree(service_settings: Settings) -> None:
    secrets_queue: Queue[str] = FORKING.Queue()
    processes = [FORKING.Process(target=_put_secret, args=(service_settings, secrets_queue)) for _ in range(4)]
    for process in processes:
        process.start()
    secrets = {secrets_queue.get(timeout=120) for _ in processes}
    for process in processes:
        process.join()
    (secret,) = secrets
    assert re.fullmatch(r"[0-9a-f]{64}", secret)
    _put_secret(service_settings, again := FORKING.Queue())
    assert again.get(timeout=60) == secret


def test_another_database_has_another_secret(tmp_path: Path) -> None:
    one, other = (load_home_secret(Settings(home=tmp_path / name)) for name in ("one", "other"))
    assert one.text != other.text


def test_a_database_of_the_first_release_gets_one(service_settings: Settings, tmp_path: Path) -> None:
    lay_first_release(service_settings.database, tmp_path).dispose()
    with open_store(service_settings) as store:
        assert len(load_secret(store).text) == 64
        with store.transaction() as session:
            assert set(session.scalars(update(Job).values(error="x").returning(Job.secret_sha256))) == {None}


def test_a_database_that_lost_it_is_not_graded_with(service_settings: Settings) -> None:
    with open_store(service_settings) as store:
        with store.transaction() as session:
            session.delete(session.get_one(Installation, 1))
        with pytest.raises(HostError, match="the secret that it was made with is gone; restore a backup"):
            load_secret(store)


def test_the_environments_wins(service_settings: Settings) -> None:
    settings = replace(service_settings, secret=Secret(SECRET))
    with open_store(settings) as store:
        assert load_secret(store) == load_home_secret(settings) == Secret(SECRET)
    with open_store(service_settings) as store:
        assert load_secret(store) == load_home_secret(service_settings) != Secret(SECRET)


def test_a_home_is_opened_once_for_its_secret(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = Settings(home=tmp_path)
    first = load_home_secret(settings)
    monkeypatch.setattr(home_secret, "_load_store_secret", lambda _: pytest.fail("opened again"))
    assert load_home_secret(settings) == first
    assert load_home_secret(Settings(database_url=f"sqlite:///{tmp_path}/robomark.db")) == first


def test_a_home_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(HostError, match=r"secret for trials cannot be saved: .* or ROBOMARK_SECRET\.$"):
        load_home_secret(Settings(home=tmp_path / "file" / "home"))


@pytest.mark.parametrize("text", ["short", "   fifteen chars   ", "x" * 15])
def test_one_that_is_too_short_is_refused_without_being_told(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("ROBOMARK_SECRET", text)
    with pytest.raises(UsageError) as caught:
        load_settings()
    assert str(caught.value) == (
        "ROBOMARK_SECRET is not usable: expected at least 16 characters that are hard to guess"
    )


def test_settings_do_not_tell_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("ROBOMARK_SECRET", f"  {SECRET}\n")
    settings = load_settings(home=tmp_path)
    assert settings.own_secret == Secret(SECRET)
    for each in (repr(settings), str(settings), settings.to_environment(), repr(settings.own_secret), vars(settings)):
        assert SECRET not in str(each)
    monkeypatch.setenv("ROBOMARK_SECRET", " ")
    assert load_settings().own_secret is None


#: Searches everything that student code can reach. The secret is scrambled, so the search does not find itself.
SEARCH = """
import gc, os, sys
def search():
    yield str(dict(os.environ))
    for path in ("/proc/self/environ", f"/proc/{{os.getppid()}}/environ", "/proc/self/maps", "{database}"):
        try:
            with open(path, encoding="latin-1") as file:
                yield file.read()
        except OSError:
            pass
    for found in gc.get_objects():
        if isinstance(found, (dict, list, tuple)):
            for each in list(found.values() if isinstance(found, dict) else found):
                if isinstance(each, (str, bytes, int)):
                    yield str(each)
def told():
    texts = list(search())
    found = []
    for number, code in enumerate({codes!r}):
        secret = "".join(chr(byte ^ 0x5A) for byte in bytes.fromhex(code))
        found += [number for text in texts if secret in text]
    return found
"""


def test_student_code_does_not_come_by_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The seed of its world is not available either, because the world could be rebuilt from it at home."""
    monkeypatch.setenv("ROBOMARK_SECRET", SECRET)
    assignment = find_assignment("echo-responder")
    assignment = type(assignment)(
        "a", "A", assignment.world, assignment.parts, assignment.scenarios[:1], assignment.criteria[:1]
    )
    (seed,) = (trial.seed for trial in assignment.trials(Secret(SECRET)))
    search = SEARCH.format(database=tmp_path / "robomark.db", codes=scrambled(SECRET, str(seed)))
    program = SourceFile("robot.py", f"{search}\nprint('PY::', told())\n")
    responder = SourceFile("responder.py", f"{search}\ndef responder(text): return str(told())\n")
    with TrialRunner() as runner:
        (trial,) = grade(Submission("s", program, responder), assignment, secret=Secret(SECRET), runner=runner).trials
    assert [message.text for message in trial.recording.messages] == ["PY:: []", "[]"]
    # The search finds an existing secret.
    kept = {"it": SECRET}
    namespace: dict[str, Any] = {}
    exec(search, namespace)
    assert 0 in namespace["told"](), kept


def _seeds(home: Path, **environment: Any) -> list[int]:
    ended = robomark("grade", ECHO, "-a", "echo-responder", "--format", "json", ROBOMARK_HOME=str(home), **environment)
    assert ended.returncode == 0, ended.stderr
    return [trial["seed"] for trial in json.loads(ended.stdout)["trials"]]


@pytest.mark.long
def test_every_home_has_its_own_worlds(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    assert _seeds(one) == _seeds(one) != _seeds(other)
    # An autograder has a new home each time.
    assert _seeds(tmp_path / "new", ROBOMARK_SECRET=SECRET) == _seeds(tmp_path / "newer", ROBOMARK_SECRET=SECRET)
    assert not (tmp_path / "new").exists()


@pytest.mark.long
def test_only_its_hash_is_told(tmp_path: Path) -> None:
    home, batch = tmp_path / "home", tmp_path / "class"
    shutil.copytree(ECHO, batch / "ada")
    environment: dict[str, Any] = {"ROBOMARK_HOME": str(home), "ROBOMARK_SECRET": SECRET, "ROBOMARK_LOG_LEVEL": "DEBUG"}
    done = [
        robomark(
            "batch", "submit", batch, "-a", "echo-responder", "--wait", "--output", tmp_path / "out", **environment
        )
    ]
    match = re.search(r"^ada .* (\w+) *$", done[0].stdout, re.MULTILINE)
    assert match is not None, done[0]
    for words in (("doctor",), ("verify", match[1]), ("show", match[1]), ("batch", "list"), ("db", "upgrade")):
        done.append(robomark(*words, **environment))
        assert done[-1].returncode == 0, done[-1]
    output = "".join(each.stdout + each.stderr for each in done)
    name = Secret(SECRET).name
    assert f"the secret in ROBOMARK_SECRET, hash {name}" in output
    assert f"secret: {name}" in output
    assert SECRET not in output
    files = [path for folder in (home, tmp_path / "out") for path in folder.rglob("*") if path.is_file()]
    assert any(path.suffix == ".log" for path in files)
    assert not any(SECRET.encode() in path.read_bytes() for path in files)
    own = load_home_secret(Settings(home=home)).text
    assert own not in output
    assert [path.name for path in files if own.encode() in path.read_bytes()] == ["robomark.db"]

    # With another secret the worlds are different, and the message says so.
    environment.pop("ROBOMARK_SECRET")
    other = robomark("verify", match[1], **environment)
    assert other.returncode == 3
    assert f"cannot be verified with this secret: it was graded with {name}" in other.stderr
    assert "set ROBOMARK_SECRET to the original secret" in other.stderr
    wrong = robomark("doctor", **environment)
    assert wrong.returncode == 3
    assert f"the newest grade has {name}: every machine needs the same" in " ".join(wrong.stdout.split())


def test_a_backup_has_it(tmp_path: Path) -> None:
    settings = Settings(home=tmp_path / "home")
    own = load_home_secret(settings)
    copy = tmp_path / "copy.db"
    assert robomark("db", "backup", copy, ROBOMARK_HOME=str(settings.home)).returncode == 0
    assert sqlite3.connect(copy).execute("SELECT secret FROM installation").fetchall() == [(own.text,)]


@pytest.mark.long
def test_grades_of_before_are_verified_in_the_worlds_of_then(tmp_path: Path) -> None:
    home, batch = tmp_path / "home", tmp_path / "class"
    shutil.copytree(locate_examples("dead-reckoning-with-noise") / "reference", batch / "ada")
    environment: dict[str, Any] = {"ROBOMARK_HOME": str(home)}
    done = robomark("batch", "submit", batch, "-a", "dead-reckoning-with-noise", "--wait", **environment)
    match = re.search(r"^ada .* (\w+) *$", done.stdout, re.MULTILINE)
    assert match is not None, done
    assert robomark("verify", match[1], **environment).returncode == 0
    with open_store(Settings(home=home)) as store, store.transaction() as session:
        session.execute(update(Job).values(secret_sha256=None))
    then = robomark("verify", match[1], **environment)
    assert "graded before this installation had a secret" in then.stderr
    # This grade has no recorded secret: its worlds differ from today's.
    assert then.returncode == 3
