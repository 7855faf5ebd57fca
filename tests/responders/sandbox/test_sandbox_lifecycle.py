"""Children and zygotes start and end: nothing is left behind, even after kills and hundreds of runs."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import select
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.harness.process_tree import read_command_line
from paths import HELPERS
from processes import alive, until
from responders.sandbox import roles
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Verdict

_WORKER = """
import sys
sys.path.insert(0, sys.argv[1])
from responders.sandbox.meter import JobMeter
from running import run_program
from service.grading.trial_runner import TrialRunner
with TrialRunner() as runner:
    while True:
        run_program(runner, sys.argv[2], responder=sys.argv[3])
"""
_ENDLESS = "while True: pass"
_ECHO = "def responder(text): return text"
_WAITING = 'import select\nprint("PY::x")\nselect.select([], [], [])'


@pytest.mark.parametrize("is_ready", [False, True], ids=["it-starts", "it-waits"])
def test_a_zygote_that_is_closed_before_its_first_child_ends_silently(
    is_ready: bool, capfd: pytest.CaptureFixture[str]
) -> None:
    with Sandboxes() as sandboxes:
        unused = sandboxes._provide_zygote("robot")
        unused.begin()
        assert unused._process is not None
        process = unused._process
        if is_ready:
            assert select.select(unused._sockets, [], [], 60)[0]
        else:
            for each in unused._sockets:
                each.close()
            unused._sockets = ()
            process.wait(60)
    assert process.poll() == 0
    assert capfd.readouterr().err == ""


@pytest.mark.long
@pytest.mark.parametrize(
    ("program", "responder"),
    [
        pytest.param(_ENDLESS, _ECHO, id="program-computes"),
        pytest.param(_WAITING, _ECHO, id="program-waits"),
        pytest.param('print("PY::x")', "def responder(text):\n    while True: pass", id="responder-computes"),
        pytest.param("pass", _ECHO, id="children-come-and-go"),
    ],
)
@pytest.mark.parametrize("killed", ["worker", "zygotes"])
def test_nothing_outlives_what_it_hangs_on(killed: str, program: str, responder: str, tmp_path: Path) -> None:
    worker = subprocess.Popen(
        [sys.executable, "-c", _WORKER, str(HELPERS), program, responder],
        stderr=subprocess.DEVNULL,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    try:
        # Two zygotes, and a child of each.
        until(lambda: len(_descendants(worker.pid)) >= 4)
        # In this order: a zygote that starts in between is killed with the others.
        family = _descendants(worker.pid)
        zygotes = _children(worker.pid)
        if killed == "worker":
            worker.kill()
            worker.wait()
            until(lambda: not any(alive(pid) for pid in family))
        else:
            for zygote in zygotes:
                # A worker that has lost one zygote may end and take the others with it before this loop reaches them.
                with contextlib.suppress(ProcessLookupError):
                    os.kill(zygote, signal.SIGKILL)
            until(lambda: not any(alive(pid) for pid in family))
    finally:
        worker.kill()
        worker.wait()


@pytest.mark.long
@pytest.mark.parametrize("who", ["it", "what is round it"])
def test_a_killed_zygote_is_our_fault_so_the_trial_is_run_again(who: str) -> None:
    others = _zygotes(os.getpid())
    with TrialRunner() as runner:
        honest = run_program(runner, "print(1)")
        (zygote,) = _zygotes(os.getpid()) - others
        if who == "it":
            # The zygote inside bubblewrap, if bubblewrap is used.
            zygote = next(iter(_children(zygote)), zygote)

        def kill() -> None:
            if alive(zygote):
                os.kill(zygote, signal.SIGKILL)

        again = run_program(runner, "sum(range(10**7)); print(1)", meter=JobMeter(heartbeat=kill))
        assert not alive(zygote)
        assert (again.verdict, again.sha256) == (Verdict.FINISHED, honest.sha256)
        (zygote,) = _zygotes(os.getpid()) - others
        family = {zygote, *_descendants(zygote)}
        os.kill(zygote, signal.SIGKILL)
        until(lambda: not any(alive(pid) for pid in family))
        assert run_program(runner, "print(1)").sha256 == honest.sha256


@pytest.mark.long
def test_five_hundred_children_leave_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured after the first fifty, when all late imports have happened."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    program = 'print("PY::x")'
    responder = "def responder(text):\n    open('file', 'w').write(text)\n    return text"
    with TrialRunner() as runner:

        def trials(count: int) -> None:
            for _ in range(count):
                assert run_program(runner, program, responder=responder).verdict is Verdict.FINISHED

        trials(25)
        processes = [os.getpid(), *_children(os.getpid())]
        before = [_state(pid) for pid in processes]
        trials(225)
        for pid, (descriptors, children, memory) in zip(processes, before, strict=True):
            now = _state(pid)
            assert now[:2] == (descriptors, children)
            assert now[2] - memory < 8 << 20
        assert [each.name for each in tmp_path.rglob("*") if each.parent != tmp_path] == []
    assert list(tmp_path.iterdir()) == []


def _state(pid: int) -> tuple[int | None, list[int], int]:
    """Return the open descriptors (if visible), the children, and the bytes of memory in use."""
    try:
        descriptors = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    except PermissionError:
        descriptors = None
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return descriptors, _children(pid), pages * os.sysconf("SC_PAGESIZE")


def _zygotes(worker: int) -> set[int]:
    """Return the children of ``worker`` that are zygotes, or that contain one in bubblewrap."""
    return {pid for pid in _children(worker) if "inside.zygote" in read_command_line(pid)}


def _parents() -> Iterator[tuple[int, int]]:
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if fields[0] != "Z":
                yield int(entry.name), int(fields[1])


def _children(pid: int) -> list[int]:
    return sorted(child for child, parent in _parents() if parent == pid)


def _descendants(pid: int) -> set[int]:
    descendants, parents = {pid}, list(_parents())
    while more := {child for child, parent in parents if parent in descendants} - descendants:
        descendants |= more
    return descendants - {pid}


def test_what_children_import_is_compiled_once_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    (tmp_path / "package").mkdir()
    sources = [tmp_path / "module.py", tmp_path / "package" / "__init__.py"]
    for source in sources:
        source.write_text("value = 1\n")
    kept = [Path(importlib.util.cache_from_source(source)) for source in sources]
    roles.compile_bytecode(tmp_path)
    before = [each.read_bytes() for each in kept]
    sources[0].write_text("value = 'another'\n")
    os.utime(kept[0], (1, 1))
    roles.compile_bytecode.cache_clear()
    roles.compile_bytecode(tmp_path)
    assert b"another" in kept[0].read_bytes()
    assert kept[1].read_bytes() == before[1]
