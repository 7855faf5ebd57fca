"""The home is private: closed when it is created, repaired if it is open, refused if others could change it."""

from __future__ import annotations

import os
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import text

from builders import settings_in
from command import robomark
from service.home import open_home
from service.queue.processes import end_processes, start_process
from service.store.engine import open_store
from sim.errors import UsageError
from submissions.assignment.examples import locate_examples

ANOTHER = 12345
AS_ROOT = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")


def _robomark(home: Path, umask: int, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return robomark(*arguments, umask=umask, ROBOMARK_HOME=str(home))


def _mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def _open(home: Path) -> list[Path]:
    """Return the paths in it that others can access."""
    return [path for path in (home, *home.rglob("*")) if path.lstat().st_mode & 0o077 and not path.is_symlink()]


def _old_home(home: Path) -> None:
    """Set the permissions of an earlier release, or of a shared folder."""
    for folder in ("", "run", "log", "broker/appendonlydir"):
        (home / folder).mkdir(parents=True, exist_ok=True)
    for file in ("log/worker.log", "run/worker.lock", "broker/appendonlydir/appendonly.aof.1.incr.aof"):
        (home / file).write_text("")
    with open_store(settings_in(home.parent / "elsewhere")):
        (home.parent / "elsewhere" / "robomark.db").rename(home / "robomark.db")
    for path in (home, *home.rglob("*")):
        path.chmod(0o777 if path.is_dir() else 0o666)


def test_an_open_home_is_repaired_and_said_so_once(tmp_path: Path) -> None:
    home = tmp_path / "home"
    _old_home(home)
    assert len(_open(home)) == 9
    first, second = (_robomark(home, 0o022, "batch", "list") for _ in range(2))
    assert first.returncode == second.returncode == 0
    assert first.stderr == (
        f"robomark: the home {home} was open to other users (9 of its files and folders); now only this user has "
        "access\n"
    )
    assert second.stderr == ""
    assert _open(home) == []


@pytest.mark.long
def test_the_home_is_private_whatever_the_umask_and_reports_go_by_it(tmp_path: Path) -> None:
    home, report, marks = tmp_path / "home", tmp_path / "reports", tmp_path / "marks.csv"
    (tmp_path / "class").mkdir()
    shutil.copytree(locate_examples("echo-responder") / "reference", tmp_path / "class" / "ada")
    submitted = ("batch", "submit", tmp_path / "class", "-a", "echo-responder", "--output", report)
    ended = _robomark(home, 0o000, *submitted)
    assert ended.returncode == 0, ended.stderr
    assert {path.name for path in home.iterdir()} >= {"robomark.db", "run", "log", "broker"}
    assert _open(home) == []
    batch = ended.stdout.partition("batch ")[2].partition(":")[0]
    assert _robomark(home, 0o000, "batch", "export", batch, "-o", marks).returncode == 0
    assert {_mode(path) for path in (*report.iterdir(), marks)} == {0o666}
    assert _mode(report) == 0o777
    # A copy of the database contains all data of the home.
    assert _robomark(home, 0o000, "db", "backup", tmp_path / "copy.db").returncode == 0
    assert _mode(tmp_path / "copy.db") == 0o600


@pytest.mark.long
@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_what_a_user_asked_for_elsewhere_goes_by_the_users_umask(tmp_path: Path, umask: int) -> None:
    (tmp_path / "robot.py").write_text("print('hello')\n")
    trace, made = tmp_path / "trace.json", tmp_path / "my-task"
    assert _robomark(tmp_path / "home", umask, "run", tmp_path / "robot.py", "--trace", trace).returncode == 0
    assert _robomark(tmp_path / "home", umask, "assignments", "new", made).returncode == 0
    assert {_mode(path) for path in (trace, made / "assignment.toml")} == {0o666 & ~umask}
    assert _mode(made) == 0o777 & ~umask


def test_a_database_is_private_whoever_opens_it_first(tmp_path: Path) -> None:
    """So are its log and its shared memory, which are beside it while it is open."""
    before = os.umask(0)
    try:
        with open_store(settings_in(tmp_path / "home")) as store, store.transaction() as session:
            session.execute(text("SELECT 1"))
            assert len(list((tmp_path / "home").iterdir())) == 3
            assert _open(tmp_path / "home") == []
    finally:
        os.umask(before)


@AS_ROOT
def test_another_users_home_is_refused(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    os.chown(home, ANOTHER, ANOTHER)
    ended = _robomark(home, 0o022, "batch", "list")
    assert ended.returncode == 2
    (sentence,) = ended.stderr.splitlines()
    assert f"{home} belongs to user {ANOTHER}" in sentence
    assert list(home.iterdir()) == []


def _writable_by_all(tmp_path: Path) -> Path:
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(0o777)
    return tmp_path / "shared" / "own" / "home"


def _above_the_users_own(_tmp_path: Path) -> Path:
    return Path.home().parent


def _a_file(tmp_path: Path) -> Path:
    (tmp_path / "home").touch()
    return tmp_path / "home"


def _in_anothers_folder(tmp_path: Path) -> Path:
    home = tmp_path / "theirs" / "home"
    home.mkdir(parents=True)
    os.chown(home.parent, ANOTHER, ANOTHER)
    return home


def _linked_into_anothers_folder(tmp_path: Path) -> Path:
    target = _in_anothers_folder(tmp_path)
    (tmp_path / "home").symlink_to(target)
    return tmp_path / "home"


def _linked_by_another(tmp_path: Path) -> Path:
    (tmp_path / "mine").mkdir()
    (tmp_path / "home").symlink_to(tmp_path / "mine")
    os.lchown(tmp_path / "home", ANOTHER, ANOTHER)
    return tmp_path / "home"


def _with_a_database_of_anothers(tmp_path: Path) -> Path:
    home = tmp_path / "home"
    _old_home(home)
    os.chown(home / "robomark.db", ANOTHER, ANOTHER)
    return home


def _with_a_link_of_anothers(tmp_path: Path) -> Path:
    home = tmp_path / "home"
    _old_home(home)
    (home / "log" / "worker.log").unlink()
    (home / "log" / "worker.log").symlink_to(tmp_path / "victim")
    os.lchown(home / "log" / "worker.log", ANOTHER, ANOTHER)
    return home


def _with_logs_that_lead_into_anothers_folder(tmp_path: Path) -> Path:
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "theirs").mkdir()
    os.chown(tmp_path / "theirs", ANOTHER, ANOTHER)
    (home / "log").symlink_to(tmp_path / "theirs")
    return home


@pytest.mark.parametrize(
    "make",
    [
        _writable_by_all,
        _above_the_users_own,
        _a_file,
        pytest.param(_in_anothers_folder, marks=AS_ROOT),
        pytest.param(_linked_into_anothers_folder, marks=AS_ROOT),
        pytest.param(_linked_by_another, marks=AS_ROOT),
        pytest.param(_with_a_database_of_anothers, marks=AS_ROOT),
        pytest.param(_with_a_link_of_anothers, marks=AS_ROOT),
        pytest.param(_with_logs_that_lead_into_anothers_folder, marks=AS_ROOT),
    ],
)
def test_a_home_that_others_can_reach_into_is_refused(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    home = make(tmp_path)
    mode = home.stat().st_mode if make is _above_the_users_own else None
    with pytest.raises(
        UsageError, match=r"the home .* (contains other files|has another owner|is not a folder|is open to other users)"
    ) as caught:
        open_home(home)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "victim").exists()
    assert mode is None or home.stat().st_mode == mode


@pytest.mark.parametrize("mode", [0o1777, 0o775, 0o755])
def test_a_home_may_lie_where_nobody_else_can_move_it(tmp_path: Path, mode: int) -> None:
    (tmp_path / "above").mkdir()
    (tmp_path / "above").chmod(mode)
    open_home(tmp_path / "above" / "home")
    assert _open(tmp_path / "above" / "home") == []


def test_a_home_may_be_a_link_of_its_own_user(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir(mode=0o755)
    (tmp_path / "home").symlink_to(tmp_path / "disk")
    open_home(tmp_path / "home")
    assert _open(tmp_path / "disk") == []


def test_what_is_not_robomarks_keeps_its_mode_behind_the_closed_door(tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "bin").mkdir(parents=True)
    (home / "bin" / "tool").touch()
    (home / "bin" / "tool").chmod(0o755)
    open_home(home)
    assert _mode(home / "bin" / "tool") == 0o755
    assert _mode(home) == 0o700


@pytest.mark.parametrize("linked", ["log", "run"])
def test_a_link_in_the_place_of_a_file_of_ours_is_not_followed(tmp_path: Path, linked: str) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine\n")
    log = tmp_path / "home" / linked / "service.log"
    log.parent.mkdir(parents=True)
    log.symlink_to(victim)
    process = start_process([sys.executable, "-c", "print('written')"], {}, log, signal.SIGKILL)
    process.wait()
    end_processes([process], 1)
    assert victim.read_text() == "mine\n"
    assert (log.is_symlink(), log.read_text()) == (False, "written\n")


def test_what_a_service_starts_makes_files_for_us_alone(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        code = "import pathlib; pathlib.Path('made').touch()"
        command = [sys.executable, "-c", f"import os; os.chdir({str(tmp_path)!r}); {code}"]
        process = start_process(command, {}, tmp_path / "log" / "a.log", signal.SIGKILL)
    finally:
        os.umask(before)
    process.wait(timeout=30)
    assert _mode(tmp_path / "made") == 0o600


@pytest.mark.long
def test_a_worker_by_itself_takes_the_umask_of_the_home(tmp_path: Path) -> None:
    """A unit file starts it in this way, without the command line."""
    process = subprocess.Popen(
        [sys.executable, "-m", "service.queue.worker"],
        env=os.environ | {"ROBOMARK_HOME": str(tmp_path / "home"), "ROBOMARK_BROKER_URL": "redis://127.0.0.1:1/0"},
        umask=0o000,
        stderr=subprocess.PIPE,
    )
    try:
        end = time.monotonic() + 60
        while not list((tmp_path / "home" / "run").glob("*.alive")) and process.poll() is None:
            assert time.monotonic() < end
            time.sleep(0.05)
        assert _open(tmp_path / "home") == []
        status = Path(f"/proc/{process.pid}/status").read_text()
        assert "Umask:\t0077" in status
    finally:
        process.kill()
        process.communicate()


def test_what_python_keeps_of_modules_is_for_whoever_reads_the_modules(tmp_path: Path) -> None:
    (tmp_path / "package").mkdir()
    source = tmp_path / "package" / "late.py"
    source.write_text("found = 1\n")
    source.chmod(0o644)  # whatever the umask of this process is now
    code = "from service.home import keep_files_private; keep_files_private(); import package.late; open('own', 'w')"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": ""}
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, umask=0o022, check=True)
    (late,) = tmp_path.rglob("late.*.pyc")
    assert (_mode(late), _mode(late.parent)) == (0o644, 0o755)
    assert _mode(tmp_path / "own") == 0o600
