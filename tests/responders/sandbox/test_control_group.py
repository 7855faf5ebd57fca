"""A control group for each slot: used where available, reported where not, and queried for killed processes.

The first tests use an invented file tree. The others run where this user can create a group with subgroups.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pytest

from benchmarks.harness.process_tree import find_descendants
from builders import settings_in
from memory_group import MemoryGroup, memory_group
from paths import HELPERS
from processes import PATIENCE, alive, until
from responders.sandbox import control_group
from responders.sandbox.control_group import ControlGroup
from service.queue.broker import EmbeddedBroker
from service.queue.processes import end_processes
from service.settings import Settings
from service.store.engine import open_store
from service.store.queue import workers
from sim.errors import HostError

HYBRID = "4:memory:/elsewhere\n1:cpu:/\n0::"
OTHER_MOUNTS = "23 1 0:28 / / rw - ext4 /dev/vda rw\n35 31 0:32 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n"


class Tree:
    """A mount of control groups as a process sees it."""

    def __init__(self, folder: Path, own: str = "/unit", root: str = "/", before: str = "0::") -> None:
        self.proc, self.mount = folder / "proc", folder / "unified"
        self.own = self.mount / Path(own).relative_to(root)
        (self.proc / "self").mkdir(parents=True)
        (self.proc / "self" / "cgroup").write_text(f"{before}{own}\n")
        mount = f"41 31 0:38 {root} {self.mount} rw,relatime shared:9 - cgroup2 cgroup2 rw,nsdelegate\n"
        (self.proc / "self" / "mountinfo").write_text(OTHER_MOUNTS + mount)
        self.fill(self.own)

    def fill(self, group: Path, processes: str = f"{os.getpid()}\n") -> None:
        group.mkdir(parents=True)
        (group / "cgroup.controllers").write_text("cpuset cpu io memory pids\n")
        (group / "cgroup.procs").write_text(processes)
        (group / "cgroup.subtree_control").write_text("")

    def why_not(self) -> str | None:
        return control_group.check_available(self.proc)


@pytest.mark.parametrize(
    ("own", "root", "before"),
    [
        pytest.param("/system.slice/robomark.service", "/", "0::", id="a unit"),
        pytest.param("/", "/", "0::", id="a container with its own name space"),
        pytest.param("/docker/4711", "/docker/4711", "0::", id="a container without"),
        pytest.param("/unit", "/", HYBRID, id="version 1 beside it"),
    ],
)
def test_a_group_is_found_and_divided(own: str, root: str, before: str, tmp_path: Path) -> None:
    tree = Tree(tmp_path, own, root, before)
    assert tree.why_not() is None
    assert control_group.divide_group(tree.proc) is None
    assert (tree.own / "robomark-service" / "cgroup.procs").read_text() == "0"
    assert (tree.own / "cgroup.subtree_control").read_text() == "+io +memory +pids"


def test_whoever_was_started_by_one_that_divided_divides_nothing_anew(tmp_path: Path) -> None:
    tree = Tree(tmp_path, "/unit/robomark-service")
    tree.fill(tree.own.parent / "made-up")
    for file in ("cgroup.controllers", "cgroup.procs", "cgroup.subtree_control"):
        (tree.own.parent / "made-up" / file).rename(tree.own.parent / file)
    (tree.own / "cgroup.procs").write_text("1\n2\n")
    assert control_group.divide_group(tree.proc) is None
    assert not (tree.own / "robomark-service").exists()
    assert (tree.own.parent / "cgroup.subtree_control").read_text() == "+io +memory +pids"


@pytest.mark.parametrize(
    ("file", "text", "reason"),
    [
        ("proc/self/cgroup", "4:memory:/\n", "the kernel has no control groups of version 2"),
        ("proc/self/cgroup", "0::/../elsewhere\n", "cannot be read: No such file"),
        ("proc/self/cgroup", None, "cannot be read"),
        ("proc/self/mountinfo", OTHER_MOUNTS, "control groups of version 2 are not mounted"),
        ("unified/unit/cgroup.controllers", "hugetlb\n", "does not have the controllers memory and pids"),
        ("unified/unit/cgroup.controllers", "cpu io pids\n", "does not have the controllers memory"),
        ("unified/unit/cgroup.controllers", None, "cannot be read: No such file"),
        ("unified/unit/cgroup.procs", "1\nthis\n", "other processes are in"),
        ("unified/unit/cgroup.subtree_control", None, "cgroup.subtree_control cannot be written"),
    ],
)
def test_what_keeps_it_from_being_divided_is_named(file: str, text: str | None, reason: str, tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    if text is None:
        (tmp_path / file).unlink()
    else:
        (tmp_path / file).write_text(text.replace("this", str(os.getpid())))
    assert reason in str(tree.why_not())
    assert control_group.divide_group(tree.proc) == tree.why_not()
    assert control_group.create_slot_group(256, tree.proc) is None
    assert not (tree.own / "robomark-service").exists()


def test_a_process_goes_back_when_the_kernel_does_not_divide(tmp_path: Path) -> None:
    tree = Tree(tmp_path)
    (tree.own / "cgroup.subtree_control").unlink()
    (tree.own / "cgroup.subtree_control").mkdir()
    assert "cannot be divided: Is a directory" in str(control_group.divide_group(tree.proc))
    assert (tree.own / "cgroup.procs").read_text() == "0"


@pytest.fixture
def slot(tmp_path: Path) -> Path:
    """Return the path of the group for this process's slot."""
    return tmp_path / f"robomark-slot-{os.getpid()}"


def test_a_slot_has_limits(slot: Path) -> None:
    ControlGroup(slot, 1536)
    limits = {file.name: file.read_text() for file in slot.iterdir()}
    assert re.fullmatch(r"\d+:\d+ wbps=33554432 wiops=500", limits.pop("io.max"))
    expected = {"memory.max": str(1536 << 20), "memory.swap.max": "0", "pids.max": "32", "io.weight": "default 10"}
    assert limits == expected


@pytest.mark.parametrize(("file", "needed"), [("memory.max", True), ("pids.max", True), ("io.max", False)])
def test_limits_that_not_every_kernel_has_are_done_without(file: str, needed: bool, slot: Path) -> None:
    (slot / file).mkdir(parents=True)
    with pytest.raises(HostError, match=slot.name) if needed else nullcontext():
        ControlGroup(slot, 1536)


def test_a_slot_has_room_for_what_the_assignment_allows(slot: Path) -> None:
    group = ControlGroup(slot, 1000)
    for limits_mb, room_mb in ((640, 1040), (8192, 8592), (100, 1000)):
        group.adjust_memory_limit(limits_mb << 20)
        assert (slot / "memory.max").read_text() == str(room_mb << 20)


@pytest.mark.parametrize(
    ("killed", "full", "overran"),
    [
        pytest.param(2, 5, False, id="nothing"),
        pytest.param(3, 5, False, id="killed because a group above was full"),
        pytest.param(2, 6, False, id="full, and nobody killed"),
        pytest.param(3, 6, True, id="killed because it was full"),
    ],
)
def test_only_a_kill_for_its_own_limit_is_its_own_fault(killed: int, full: int, overran: bool, slot: Path) -> None:
    events = "low 0\nhigh 0\nmax 77\noom {}\noom_kill {}\noom_group_kill 0\n"
    slot.mkdir()
    (slot / "memory.events").write_text(events.format(5, 2))
    watch = ControlGroup(slot, 1536).watch_memory_kills()
    (slot / "memory.events").write_text(events.format(full, killed))
    assert watch() is overran


def test_groups_of_dead_slots_are_removed_and_no_others(slot: Path) -> None:
    ended = subprocess.Popen(["true"])
    ended.wait()
    dead, alive, other = (slot.parent / f"{name}" for name in (f"robomark-slot-{ended.pid}", "robomark-slot-1", "x"))
    for folder in (dead, alive, other):
        folder.mkdir()
    ControlGroup(slot, 1536)
    assert [folder.exists() for folder in (dead, alive, other)] == [False, True, True]


def in_group(script: str, memory_bytes: int = 3 << 30, **environment: str) -> tuple[Any, str]:
    """Run a script alone in a group that it may divide; return its final output and its log."""
    with memory_group(memory_bytes) as group:
        ran = subprocess.run(
            [sys.executable, "-c", _BEGIN + script],
            env=os.environ | {"PYTHONPATH": str(HELPERS)} | environment,
            preexec_fn=_of_version_2(group).enter,
            capture_output=True,
            text=True,
            check=False,
        )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout.splitlines()[-1]), ran.stderr


def _of_version_2(group: MemoryGroup | None) -> MemoryGroup:
    if group is None or group.limit != "memory.max":
        pytest.skip("no control group of version 2 with a memory limit can be made here")
    return group


_BEGIN = """
import json, logging, os, sys
from pathlib import Path
from responders.sandbox import control_group
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from running import run_program
from service.grading.trial_runner import TrialRunner

logging.basicConfig(stream=sys.stderr)
assert control_group.divide_group() is None, control_group.divide_group()
here = control_group._locate_own_group(Path("/proc"))
assert here.name == "robomark-service"
slot = here.parent / f"robomark-slot-{os.getpid()}"
ECHO = "def responder(text): return text\\n"
BUSY = "print('PY::a')\\nsum(range(10**7))"
def runner(memory_mb=1536):
    return TrialRunner(Sandboxes(group=control_group.create_slot_group(memory_mb)))
"""


def test_all_processes_of_a_slot_are_in_its_group_and_none_other() -> None:
    output, _ = in_group(
        """
seen = set()
def look():
    seen.add((slot / "cgroup.procs").read_text())
with runner() as made:
    sandbox = run_program(made, BUSY, responder=ECHO, meter=JobMeter(heartbeat=look)).sandbox
    inside = {int(pid) for pids in seen for pid in pids.split()}
    limits = [(slot / file).read_text().strip() for file in ("memory.max", "pids.max")]
print(json.dumps([sandbox, len(inside), os.getpid() in inside, limits, slot.exists()]))
"""
    )
    sandbox, inside, worker_inside, limits, left_over = output
    assert "control group" in sandbox
    assert inside >= 4  # two zygotes and their children
    assert not worker_inside
    assert limits == [str(1536 << 20), "32"]
    assert not left_over


#: Each uses more than 300 MB, and less than the 512 MB limit of its process.
HOGS = {
    "bytes": "held = [bytearray(1 << 20) for _ in range(480)]",
    "one text": "held = 'x' * (480 << 20)",
    "objects": "held = [[0] * 1000 for _ in range(60_000)]",
    "arrays": "import numpy\nheld = [numpy.ones(1 << 17) for _ in range(480)]",
    "shared memory": "import mmap\nheld = mmap.mmap(-1, 480 << 20)\nfor at in range(0, len(held), 4096): held[at] = 1",
    "files without a name": """
import os
held = []
for number in range(24):
    held.append(open('x', 'w+b', buffering=0))
    held[-1].write(bytes(4 << 20))
    os.unlink('x')
held += [bytearray(1 << 20) for _ in range(320)]
""",
    "in an answer": "def responder(text): return str(len([bytearray(1 << 20) for _ in range(480)]))",
}


def test_whoever_is_killed_for_the_limit_of_its_slot_is_at_fault_at_once() -> None:
    output, log = in_group(
        f"""
control_group._EXTRA_MEMORY = -(1 << 30)  # else a slot is never smaller than what the assignment allows
told = {{}}
with runner(330) as made:
    for name, hog in {HOGS!r}.items():
        told[name] = [[fault.verdict, fault.message] for fault in run_program(made, BUSY, responder=hog).faults]
    honest = run_program(made, BUSY, responder=ECHO).verdict
print(json.dumps([told, honest]))
""",
        TMPDIR="/dev/shm",
    )
    fault_text, honest = output
    sentence = "the responder was stopped: the submission's processes took more memory together than they may have"
    assert fault_text == {name: [["memory_limit", sentence]] for name in HOGS}
    assert honest == "finished"
    assert "run again" not in log


def test_whoever_is_killed_because_a_group_above_is_full_is_run_again() -> None:
    output, log = in_group(
        f"""
with runner() as made:
    faults = run_program(made, BUSY, responder={HOGS["bytes"]!r}).faults
print(json.dumps([[fault.verdict, fault.message] for fault in faults]))
""",
        memory_bytes=450 << 20,
    )
    ((verdict, message),) = output
    assert verdict == "memory_limit"
    assert "with nothing else running" in message
    assert "run again" in log


def test_a_worker_divides_its_group_and_leaves_nothing_that_grows(tmp_path: Path) -> None:
    settings = settings_in(tmp_path, concurrency=1)
    with open_store(settings) as store, EmbeddedBroker(settings) as broker, memory_group(3 << 30) as made:
        group = _of_version_2(made)

        def slots() -> set[Path]:
            """Return the slots that contain a zygote."""
            return {file.parent for file in group.folder.glob("robomark-slot-*/cgroup.procs") if file.read_text()}

        def sandbox() -> list[str]:
            with store.reading() as session:
                return [seen.worker.sandbox for seen in workers.load_workers(session)]

        with _worker(broker.settings, group.folder) as worker:
            assert "control group" in until(sandbox)[0]
            (killed,) = until(
                lambda: slots() & {group.folder / f"robomark-slot-{pid}" for pid in find_descendants(worker.pid)}
            )
            below = find_descendants(worker.pid)
            worker.kill()
        until(lambda: not any(alive(pid) for pid in below))
        assert killed.exists()
        with _worker(broker.settings, group.folder / "robomark-service") as worker:
            until(lambda: not killed.exists())
            until(lambda: len(sandbox()) > 1)
            until(slots)
            end_processes([worker], PATIENCE)
        assert list(group.folder.glob("robomark-slot-*")) == []


@contextmanager
def _worker(settings: Settings, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    with (settings.home / "worker.log").open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "service.queue.worker"],
            env=os.environ | settings.to_environment(),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            preexec_fn=lambda: (folder / "cgroup.procs").write_text("0"),
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
