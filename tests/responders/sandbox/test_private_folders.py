"""Folders of trials are removed once their worker has certainly ended, and never earlier, in any namespace."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from responders.sandbox.private_folders import PrivateFolders, remove_stale_folders

_WORKER = """
import sys
from responders.sandbox.private_folders import PrivateFolders
folders = PrivateFolders()
with folders.one() as trial:
    (trial / "weights.joblib").write_bytes(b"hers")
    print(trial, flush=True)
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@contextmanager
def _worker(temporary: Path, *wrapping: str) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """Start a worker in the middle of a trial; yield it and the trial's folder."""
    process = subprocess.Popen(
        [*wrapping, sys.executable, "-c", _WORKER],
        env=os.environ | {"TMPDIR": str(temporary)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        yield process, Path(process.stdout.readline().strip())
    finally:
        process.kill()
        process.communicate()


def test_the_folder_of_a_killed_worker_is_removed_by_the_next(tmp_path: Path) -> None:
    with _worker(tmp_path) as (process, trial):
        process.kill()
        process.wait()
        assert trial.exists()
        remove_stale_folders()
        assert list(tmp_path.iterdir()) == []


def test_the_folder_of_a_living_worker_is_left_as_it_is(tmp_path: Path) -> None:
    with _worker(tmp_path) as (process, trial):
        remove_stale_folders()
        assert (trial / "weights.joblib").read_bytes() == b"hers"
        process.communicate("")  # it ends by itself and removes only its trial's folder
        assert not trial.exists()
        remove_stale_folders()
        assert list(tmp_path.iterdir()) == []


def test_a_worker_whose_process_id_says_nothing_here_keeps_its_folder(tmp_path: Path) -> None:
    """A container can share the temporary folder: our process ids mean nothing inside it."""
    unshare = [shutil.which("unshare") or "", "--pid", "--fork", "--kill-child"]
    if not unshare[0] or subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no name space of processes can be made here")
    with _worker(tmp_path, *unshare) as (_, trial):
        remove_stale_folders()
        assert (trial / "weights.joblib").exists()
    with _worker(tmp_path) as (_, trial):
        looking = "from responders.sandbox.private_folders import remove_stale_folders; remove_stale_folders()"
        subprocess.run(
            [*unshare, sys.executable, "-c", looking], env=os.environ | {"TMPDIR": str(tmp_path)}, check=True
        )
        assert (trial / "weights.joblib").exists()


def test_what_only_looks_like_a_left_over_is_left_alone(tmp_path: Path) -> None:
    keep = tmp_path / "keep"
    keep.mkdir()
    (keep / "file").touch()
    (tmp_path / "robomark-trials-link").symlink_to(keep)
    (tmp_path / "robomark-trials-file").touch()
    (tmp_path / "robomark-trials").mkdir()
    anothers = tmp_path / "robomark-trials-another"
    anothers.mkdir()
    left = {"keep", "robomark-trials-link", "robomark-trials-file", "robomark-trials"}
    if os.getuid() == 0:
        os.chown(anothers, 12345, 12345)
        left.add(anothers.name)
    remove_stale_folders()
    assert {path.name for path in tmp_path.iterdir()} == left
    assert (keep / "file").exists()


def test_a_folder_that_was_tidied_away_is_made_again_and_locked_again(tmp_path: Path) -> None:
    folders = PrivateFolders()
    first = folders.path
    shutil.rmtree(first)
    with folders.one() as trial:
        assert trial.parent == first
        remove_stale_folders()
        assert trial.exists()
        assert first.stat().st_mode & 0o777 == 0o711
        assert trial.stat().st_mode & 0o777 == 0o700
    folders.close()
    assert list(tmp_path.iterdir()) == []


def test_folders_that_nobody_asked_for_are_closed_without_a_trace(tmp_path: Path) -> None:
    folders = PrivateFolders()
    folders.close()
    folders.close()
    assert list(tmp_path.iterdir()) == []


_GAPS = """
import itertools, tempfile
from responders.sandbox.private_folders import PrivateFolders
tempfile.tempdir = {folder!r}
folders, numbers = PrivateFolders(), []
for made in {made!r}:
    with folders.one() as trial:
        (trial / "own").touch()
        numbers.append((trial / "own").stat().st_ino)
        for place in range(made):
            (trial / str(place)).touch()
folders.close()
print(*{{later - earlier for earlier, later in itertools.pairwise(numbers)}})
"""


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount")
def test_where_files_are_numbered_on_and_on_every_trial_takes_up_as_many_numbers(tmp_path: Path) -> None:
    """Uses a separate file system, where no other process takes inode numbers."""
    made = [0, 299, 0, 1, 150, 299, 299, 0, 0]
    code = _GAPS.format(folder=str(tmp_path), made=made)
    script = f'mount -t tmpfs none {tmp_path} && exec {sys.executable} -c "$0"'
    ran = subprocess.run(["unshare", "--mount", "sh", "-c", script, code], capture_output=True, text=True, check=False)
    if any(name in ran.stderr for name in ("unshare:", "mount:")):
        pytest.skip(f"this machine lets root mount nothing: {ran.stderr}")
    assert ran.returncode == 0, ran.stderr
    assert len(ran.stdout.split()) == 1


def test_where_low_numbers_are_taken_the_number_of_a_trials_first_file_is_anybodys_guess(tmp_path: Path) -> None:
    folders = PrivateFolders()
    numbers = set()
    for _ in range(20):
        with folders.one() as trial:
            own = trial / "own"
            own.touch()
            numbers.add(own.stat().st_ino)
    folders.close()
    assert len(numbers) > 5
    assert list(tmp_path.iterdir()) == []
