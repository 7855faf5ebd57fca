"""Temporary files of uploads are removed with the web server, or when the next one starts."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import pytest

from builders import read_named_batch
from service.web.temporary_files import own_temporary_folder
from sim.errors import UsageError
from web import Web
from zips import zipped

_SERVER = """
import sys, tempfile, time
from service.web.temporary_files import own_temporary_folder
with own_temporary_folder() as folder:
    with tempfile.TemporaryDirectory(prefix="robomark-upload-") as upload:
        print(upload, flush=True)
        time.sleep(600)
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the system's temporary folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_a_killed_servers_uploads_are_removed_at_the_next_start_and_a_living_ones_stay(temporary: Path) -> None:
    started = [
        subprocess.Popen(
            [sys.executable, "-c", _SERVER],
            env={**os.environ, "TMPDIR": str(temporary)},
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    try:
        folders = [Path(each.stdout.readline().strip()) for each in started if each.stdout]
        assert all(folder.is_dir() for folder in folders)
        started[0].send_signal(signal.SIGKILL)
        started[0].wait()
        assert folders[0].is_dir()
        with own_temporary_folder() as own:
            assert not folders[0].exists()
            assert folders[1].is_dir()
            assert Path(tempfile.gettempdir()) == own
        assert not own.exists()
        assert Path(tempfile.gettempdir()) == temporary
    finally:
        for each in started:
            each.kill()
            each.communicate()


def test_old_folders_without_a_lock_are_removed_and_others_stay(temporary: Path) -> None:
    names = ("robomark-upload-old", "robomark-batch-old", "robomark-upload-new", "other-old")
    for name in names:
        (temporary / name).mkdir()
        (temporary / name / "upload.zip").touch()
        if name.endswith("old"):
            os.utime(temporary / name, (time.time() - 90_000,) * 2)
    (temporary / "robomark-people-link").symlink_to(temporary / "other-old")
    with own_temporary_folder():
        left = {path.name for path in temporary.iterdir() if not path.name.startswith("robomark-web-")}
    assert left == {"robomark-upload-new", "other-old", "robomark-people-link"}
    assert (temporary / "other-old" / "upload.zip").exists()


def test_a_batch_unpacks_to_so_many_times_its_size_and_no_more(tmp_path: Path) -> None:
    path = tmp_path / "batch.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(30):
            archive.writestr(f"s{number}.py", "#" * 4_000_000)
    assert path.stat().st_size < 200_000
    with pytest.raises(UsageError, match="unpacks to more than"):
        read_named_batch(path, "echo-responder")


def test_one_batch_is_unpacked_at_a_time(web: Web, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.web.context._SLOT_SECONDS", 0.1)
    grace = web.instructor()
    browser, token = web.browser(), web.token(grace, "manage", "read", "submit", "mark")
    kind = {**token, "content-type": "application/zip"}
    path = "/api/v1/courses/1/batches/preflight?assignment=echo-responder"
    data = zipped({"ada.py": "print(1)\n"})
    with web.app.state.context.unpacking:
        assert browser.post(path, headers=kind, content=data).status_code == 503
    assert browser.post(path, headers=kind, content=data).status_code != 503
