"""Requirements for hidden trials: if a trial could leave data for the next one, none is graded on this machine.

``test_attacks.py`` tests the channels themselves.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from builders import echo
from responders.sandbox import access_times
from responders.sandbox.inside import grants
from responders.sandbox.isolation import Isolation
from responders.sandbox.manager import Sandboxes
from responders.source_file import SourceFile
from service.doctor import examine_machine
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.settings import Settings
from sim.errors import HostError
from submissions.submission import Submission

_SUBMISSION = Submission(
    "ada", SourceFile("robot.py", "pass"), SourceFile("responder.py", "def responder(m): return m")
)
_WEEK = 7 * 86400

#: Refuses filters with a listener, as inside a container that already has such a filter, then continues.
_NOBODY_ANSWERS = """
import ctypes, struct, sys
code = [(0x20, 0, 0, 0), (0x15, 0, 3, 317), (0x20, 0, 0, 24), (0x45, 0, 1, 8)]  # seccomp with a listener
code += [(6, 0, 0, 0x50010), (6, 0, 0, 0x7FFF0000)]  # EBUSY, or go on
filter = b"".join(struct.pack("=HBBI", *each) for each in code)
buffer = ctypes.create_string_buffer(filter, len(filter))
libc = ctypes.CDLL(None, use_errno=True)
libc.prctl(38, 1, 0, 0, 0)
assert libc.syscall(317, 1, 0, struct.pack("=H6xQ", len(code), ctypes.addressof(buffer))) == 0
"""
_CHECK = """
from responders.sandbox.manager import Sandboxes
with Sandboxes() as sandboxes:
    print(sandboxes.check_isolation())
    print(sandboxes.check_data_leaks())
"""
#: A container can have devices on a mount that records access times. No way of reading a device records one.
_USE_A_DEVICE = """
import os, sys
from responders.sandbox import access_times
device = sys.argv[1] + "/null"
os.utime(device, (0, 0))
with open(device, "r+b", buffering=0) as file:
    file.read(1), file.write(b"x"), os.pread(file.fileno(), 1, 0)
print(os.stat(device).st_atime_ns, access_times.read_beforehand([device]))
"""
_READ = """
import sys
from responders.sandbox import access_times
from responders.sandbox.inside import grants
print(access_times.read_beforehand([sys.argv[1]]))
"""


@pytest.fixture
def readable(tmp_path: Path) -> Path:
    """Return a folder with a file, an empty file, a folder and a link, all last accessed over a week ago."""
    folder = tmp_path / "folder"
    (folder / "inner").mkdir(parents=True)
    (folder / "file").write_text("content")
    (folder / "empty").touch()
    (folder / "link").symlink_to("file")
    _age(folder)
    return folder


def _age(folder: Path) -> None:
    for path in (*folder.iterdir(), folder):
        os.utime(path, (time.time() - _WEEK, path.lstat().st_mtime), follow_symlinks=False)


def _dates(folder: Path) -> dict[str, int]:
    return {path.name: path.lstat().st_atime_ns for path in (*folder.iterdir(), folder)}


def _read_all(folder: Path) -> None:
    (folder / "file").read_text()
    (folder / "empty").read_text()
    list((folder / "inner").iterdir())
    (folder / "link").resolve()
    (folder / "link").readlink()


def test_what_was_read_beforehand_is_not_dated_again(readable: Path) -> None:
    _read_all(readable)
    dated = _dates(readable)
    _age(readable)
    if _dates(readable) == dated:
        pytest.skip("nothing is dated on this file system")
    assert access_times.read_beforehand([str(readable)]) is None
    before = _dates(readable)
    time.sleep(0.02)
    _read_all(readable)
    assert _dates(readable) == before


def test_a_file_from_the_future_is_dated_at_each_reading(readable: Path) -> None:
    os.utime(readable / "file", (time.time(), time.time() + _WEEK))
    if access_times.read_beforehand([str(readable)]) is None:
        pytest.skip("nothing is dated on this file system")
    # The kernel dates by a clock that ticks every few milliseconds.
    time.sleep(0.02)
    assert "dated in the future" in str(access_times.read_beforehand([str(readable)]))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount")
@pytest.mark.parametrize(
    ("option", "sentence"),
    [("strictatime", "neither relatime nor noatime"), ("noatime", "None"), ("relatime", "None"), ("ro", "None")],
)
def test_how_it_is_mounted_decides(option: str, sentence: str, tmp_path: Path) -> None:
    assert sentence in _in_a_mount(option, _READ, tmp_path)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount")
def test_a_device_is_not_dated_however_it_is_mounted(tmp_path: Path) -> None:
    assert _in_a_mount("strictatime", _USE_A_DEVICE, tmp_path, f"mknod {tmp_path}/null c 1 3") == "0 None\n"


def _in_a_mount(option: str, code: str, folder: Path, first: str = "true") -> str:
    """Return the output of Python code about a folder with this mount option."""
    script = f"mount -t tmpfs -o {option} none {folder} && {first} && exec {sys.executable} -c '{code}' {folder}"
    ran = subprocess.run(["unshare", "--mount", "sh", "-c", script], capture_output=True, text=True, check=False)
    if any(name in ran.stderr for name in ("unshare", "mount", "mknod")):
        pytest.skip(f"this machine lets root mount nothing: {ran.stderr}")
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def test_this_machine_forgets(tmp_path: Path) -> None:
    listed = Path(grants.list_listable_folders([])[0])
    os.utime(listed, (0, listed.stat().st_mtime))
    with Sandboxes(Isolation(bubblewrap=False)) as sandboxes:
        assert sandboxes.check_data_leaks() is None
    assert listed.stat().st_atime > listed.stat().st_ctime
    findings = {finding.what: finding for finding in examine_machine(Settings(home=tmp_path))}
    assert (findings["between trials"].well, findings["between trials"].sentence) == (
        True,
        "no data remains between trials",
    )


def test_without_a_doorkeeper_the_sandbox_stands_and_the_reason_is_told() -> None:
    with Sandboxes(Isolation(doorkeeper=False, bubblewrap=False)) as sandboxes:
        assert "doorkeeper" not in sandboxes.check_isolation()
        assert "not asked for" in str(sandboxes.check_data_leaks())
    ran = subprocess.run([sys.executable, "-c", _NOBODY_ANSWERS + _CHECK], capture_output=True, text=True, check=True)
    sandbox, reason = ran.stdout.splitlines()
    assert "seccomp" in sandbox
    assert "doorkeeper" not in sandbox
    assert "Device or resource busy" in reason


def test_nothing_hidden_is_graded_where_a_trial_could_leave_something() -> None:
    hidden = replace(echo(), scenarios=tuple(replace(each, visibility="hidden") for each in echo().scenarios))
    with TrialRunner(Sandboxes(Isolation(doorkeeper=False))) as runner:
        assert grade(_SUBMISSION, echo(), runner=runner).trials
        with pytest.raises(
            HostError, match=r"^a trial could leave data for the next, so hidden scenarios are not graded"
        ):
            grade(_SUBMISSION, hidden, runner=runner)
    with TrialRunner() as runner:
        assert grade(_SUBMISSION, hidden, runner=runner).trials


def test_what_is_read_is_read_again_after_half_a_day(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[float] = []
    clock = [time.time()]
    monkeypatch.setattr(access_times, "read_beforehand", lambda *_: read.append(clock[0]))
    monkeypatch.setattr("responders.sandbox.manager.time.time", lambda: clock[0])
    with Sandboxes(Isolation(bubblewrap=False)) as sandboxes:
        for hours in (0, 1, 10, 2, 20, -100):
            clock[0] += 3600 * hours
            assert sandboxes.check_data_leaks() is None
    start = read[0]
    assert [round((when - start) / 3600) for when in read] == [0, 13, 33, -67]
