"""Runs attacks inside a child, against decoys made for each attack: files, a process and servers.

The evidence has two parts: the attack's own report, and an inspection of the decoys from outside afterwards.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from attacks import (
    file_changes,
    files,
    kernel,
    memory,
    metadata,
    network,
    processes,
    programs,
    remembering,
    signals,
    tools,
)
from filter_machine import listed
from responders import wire
from responders.sandbox import manager
from responders.sandbox.child_exit import KilledFromOutside
from responders.sandbox.inside import lockdown
from responders.sandbox.isolation import NO_ISOLATION, Isolation
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import ChildStopped
from responders.sandbox.roles import ChildRole
from responders.sandbox.running_child import ChildLimits
from responders.sandbox.served_child import LibrariesNeeded, ServedChild
from sim.recording import TICK, Verdict

GROUPS = (files, file_changes, metadata, processes, signals, programs, network, kernel, memory)
LIMITS = ChildLimits(4.0, 256 << 20)

#: The settings in which an attack must succeed, by the layer that stops it. Otherwise its test would prove nothing.
GETS_THROUGH = {
    tools.LANDLOCK: frozenset({"none", "seccomp"}),
    tools.SECCOMP: frozenset({"none", "landlock", "landlock-1"}),
    tools.DOORKEEPER: frozenset({"none", "no-doorkeeper"}),
    tools.EITHER: frozenset({"none"}),
    tools.NEWER: frozenset({"none", "landlock-1"}),
    tools.REMAINS: frozenset({"none", "full", "full-1"}),
    tools.UNTRIED: frozenset(),
    tools.NOWHERE: frozenset(),
}
SETTINGS = {
    "full": Isolation(bubblewrap=False),
    "full-1": Isolation(landlock=1, bubblewrap=False),
    "bubblewrap": Isolation(),
    "none": NO_ISOLATION,
    "landlock": Isolation(seccomp=False, doorkeeper=False, bubblewrap=False),
    "landlock-1": Isolation(landlock=1, seccomp=False, doorkeeper=False, bubblewrap=False),
    "seccomp": Isolation(landlock=0, doorkeeper=False, bubblewrap=False),
    "no-doorkeeper": Isolation(doorkeeper=False, bubblewrap=False),
}
#: An interpreter that every user can read, if the machine has one.
SYSTEM_PYTHON = "/usr/bin/python3.11"
#: A secret in the worker's environment and memory while attacks run.
SECRET = "decoy-of-the-worker-51c9"
SCHEMAS = {"robot": wire.ROBOT, "responder": wire.RESPONDER}
_TOOLS = Path(tools.__file__).read_text()
_NUMBERS = {name: number for number, name, _ in listed()}

#: The bits that the first half of a two-part attack leaves, in order.
_BITS = (1, 0, 0, 1, 1, 0, 1, 0, 0, 0, 1, 1)
_OLD = 1_500_000_000

#: The first lines of the student's file: this module's ``tools`` under their usual name, then the group and the attack.
_FRAME = """
import sys, types
def module(name, text):
    made = sys.modules[name] = types.ModuleType(name)
    exec(compile(text, name, "exec"), made.__dict__)
    return made
module("attacks", "")
tools = module("attacks.tools", {tools!r})
tools.numbers.update({numbers!r})
tools.targets.__dict__.update({targets!r})
tools.disarm()
group = module("group", {group!r})
{attack}
def responder(text): return text
"""


@dataclass(frozen=True)
class Attack:
    """An attack: its group, its name, and the layer that stops it."""

    group: str
    name: str
    stopped_by: str
    text: str = field(repr=False)
    at_once: bool = False  # two-part attacks: whether both halves run together

    @property
    def id(self) -> str:
        return f"{self.group}-{self.name}"


def attacks() -> list[Attack]:
    """Return all one-part attacks, in the order of their files."""
    return [
        Attack(group.__name__.rpartition(".")[2], name, value.stopped_by, Path(group.__file__ or "").read_text())
        for group in GROUPS
        for name, value in vars(group).items()
        if hasattr(value, "stopped_by")
    ]


def memories() -> list[Attack]:
    """Return the two-part attacks: the first half leaves a bit for the second."""
    text = Path(remembering.__file__).read_text()
    return [
        Attack("remembering", name, value.kept_by, text, value.at_once)
        for name, value in vars(remembering).items()
        if hasattr(value, "kept_by")
    ]


class Victim:
    """A sleeping process with a secret. It is restarted after an attack has affected it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def fresh(self) -> subprocess.Popen[bytes]:
        """Return the process, alive and unchanged."""
        process = self._process
        if process is not None and process.poll() is None and os.getpriority(os.PRIO_PROCESS, process.pid) == 0:
            return process
        self.close()
        self._process = subprocess.Popen(
            ["sleep", "1000"],
            env={"SECRET": "of the victim"},
            stdin=subprocess.DEVNULL,
            preexec_fn=_without_powers,
        )
        return self._process

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


class Decoys:
    """The targets of attacks: a folder with secrets, a process, and servers."""

    def __init__(self, home: Path, victim: Victim) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="secrets-", dir=home))
        self.key, self.ssh = self.folder / "key", self.folder / "id_rsa"
        self.key.write_text("the grading key")
        self.ssh.write_text("a private key")
        for secret in (self.key, self.ssh):
            secret.chmod(0o600)
            os.utime(secret, (1_600_000_000, 1_600_000_000))
        (self.folder / "grader_secret.py").write_text("answer = 42\n")
        (self.folder / "empty").mkdir()
        self.victim = victim.fresh()
        self._servers = (
            _server(socket.AF_INET, socket.SOCK_STREAM, ("127.0.0.1", 0)),
            _server(socket.AF_INET, socket.SOCK_DGRAM, ("127.0.0.1", 0)),
            _server(socket.AF_UNIX, socket.SOCK_STREAM, str(self.folder / "server")),
            _server(socket.AF_UNIX, socket.SOCK_STREAM, f"\0{self.folder.name}"),
            _server(socket.AF_UNIX, socket.SOCK_DGRAM, f"\0{self.folder.name}-datagram"),
        )
        self._before = self._look()

    def targets(self) -> dict[str, Any]:
        tcp, udp, *_ = (server.getsockname() for server in self._servers)
        return {
            "folder": str(self.folder),
            "key": str(self.key),
            "ssh": str(self.ssh),
            "victim": self.victim.pid,
            "worker": os.getpid(),
            "tcp": tcp[1],
            "udp": udp[1],
            "unix": str(self.folder / "server"),
            "abstract": self.folder.name,
            "abstract_datagram": f"{self.folder.name}-datagram",
            "scrambled": scrambled(SECRET, "the grading key", "a private key"),
        }

    def harm(self) -> list[str]:
        """Return the changes since the decoys were made, as sentences."""
        damages = [f"{name} is now {after}" for name, after in self._look().items() if self._before[name] != after]
        return damages + [f"{server.getsockname()!r} was reached" for server in self._servers if _reached(server)]

    def close(self) -> None:
        for server in self._servers:
            server.close()

    def _look(self) -> dict[str, object]:
        seen: dict[str, object] = {
            "the folder": sorted(each.name for each in self.folder.iterdir()),
            "the victim": self.victim.poll(),
        }
        seen["its priority"] = os.getpriority(os.PRIO_PROCESS, self.victim.pid) if self.victim.poll() is None else None
        for secret in (self.key, self.ssh):
            if secret.exists():
                status = secret.stat()
                seen[secret.name] = (secret.read_bytes(), status.st_mode, status.st_nlink, status.st_mtime)
                seen[f"attributes of {secret.name}"] = os.listxattr(secret)
            else:
                seen[secret.name] = seen[f"attributes of {secret.name}"] = None
        return seen


def readable_tree(folder: Path) -> Path:
    """Create copies of our package folders with additional files, folders and links in them, and links beside them."""
    folder.chmod(0o755)
    project_root = Path(manager.__file__).parents[2]
    for name in ("sim/brick", "responders/kit"):
        shutil.copytree(project_root / name, folder / name)
        more = folder / name / "more"
        more.mkdir()
        for turn in range(len(_BITS)):
            (more / f"file-{turn}").write_bytes(bytes(4096))
            (more / f"pages-{turn}").write_bytes(bytes(65536))
            (more / f"link-{turn}").symlink_to("nowhere")
            (more / f"folder-{turn}").mkdir()
            (more / f"folder-{turn}" / "nothing").touch()
    (folder / "links").mkdir()
    for turn in range(len(_BITS)):
        (folder / "links" / f"link-{turn}").symlink_to("nowhere")
    os.sync()
    return folder


def unread(folder: Path) -> None:
    """Reset a readable tree: no recorded accesses, and no pages in memory."""
    for path in (*folder.glob("*/*/more/*"), *folder.glob("links/*")):
        os.utime(path, (_OLD, _OLD), follow_symlinks=False)
        if path.name.startswith("pages"):
            with path.open("rb") as file:
                os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def attack_text(attack: Attack, targets: dict[str, Any]) -> str:
    """Return a student's file that runs an attack and prints its result."""
    return _text(f"tools.report(group.{attack.name})", attack, targets)


def _text(line: str, attack: Attack, targets: dict[str, Any]) -> str:
    return _FRAME.format(tools=_TOOLS, numbers=_NUMBERS, targets=targets, group=attack.text, attack=line)


def run_together(
    sandboxes: Sandboxes, role: ChildRole, group: Sequence[Attack], targets: dict[str, Any]
) -> dict[str, str]:
    """Run the attacks of one group in as few children as possible, and return their results by name.

    An attack may profit from the attacks before it. If one ends the child, the next child begins with the one after it.
    """
    results: dict[str, str] = {}
    while remaining := group[len(results) :]:
        lines = [f'tools.report(group.{attack.name}, "{attack.name} ")' for attack in remaining]
        with sandboxes.open_private_folder() as folder:
            printed, stop = run_text(sandboxes, role, _text("\n".join(lines), remaining[0], targets), folder)
        reports = dict(line.split(" ", 1) for line in printed if " " in line)
        for attack in remaining:
            if attack.name not in reports:
                break
            results[attack.name] = reports[attack.name]
        else:
            continue
        results[attack.name] = _describe_stop(stop)
    return results


def scrambled(*secrets: str) -> list[str]:
    """Return the secrets in scrambled form, for an attack that searches for them."""
    return [bytes(byte ^ 0x5A for byte in secret.encode()).hex() for secret in secrets]


def run(sandboxes: Sandboxes, role: ChildRole, attack: Attack, targets: dict[str, Any]) -> str:
    """Run an attack in a new folder and return its result: ``LEAK ...``, or how it was blocked."""
    with sandboxes.open_private_folder() as folder:
        output, stop = run_text(sandboxes, role, attack_text(attack, targets), folder)
    leaks = [line for line in output if line.startswith("LEAK")]
    if leaks:
        return leaks[0]
    return "\n".join(output) if stop is None else _describe_stop(stop)


def _describe_stop(stop: ChildStopped | None) -> str:
    """Return the result of an attack that ended its child."""
    if stop is None:
        return "LEAK it ended the file without a word"
    if stop.verdict is Verdict.HOST_ERROR:
        return f"LEAK it died as if somebody else had killed it ({stop.message})"
    if any(words in stop.message for words in ("not JSON", "without its number")):
        return f"LEAK another program wrote on the wire ({stop.message})"
    return stop.message


def remembered(sandboxes: Sandboxes, role: ChildRole, attack: Attack, targets: dict[str, Any]) -> str:
    """Run a two-part attack and return its result: ``LEAK ...`` if the second half read all the bits of the first."""
    received_bits: list[int] = []
    for turn, bit in enumerate(_BITS):
        answer = _one_bit(sandboxes, role, attack, targets | {"since": time.time()}, turn, bit)
        if not answer.startswith("found "):
            return answer
        received_bits.append(int(answer.removeprefix("found ")))
    ones, zeros = ([value for value, bit in zip(received_bits, _BITS, strict=True) if bit == which] for which in (1, 0))
    apart = min(ones) > max(zeros) or max(ones) < min(zeros)
    return f"LEAK {received_bits}" if apart else f"blocked {received_bits}"


def _one_bit(
    sandboxes: Sandboxes, role: ChildRole, attack: Attack, targets: dict[str, Any], turn: int, bit: int
) -> str:
    """Return the output of the second half, or that of the first half if it failed."""
    leave, find = (
        f"tools.tell(lambda: group.{call})" for call in (f"{attack.name}({turn}, {bit})", f"{attack.name}.find({turn})")
    )
    with contextlib.ExitStack() as first:
        folder = first.enter_context(sandboxes.open_private_folder())
        child = first.enter_context(_running(sandboxes, role, _text(leave, attack, targets), folder))
        output, stop = _heard(child, role, "ready ")
        if any(line.startswith("blocked") for line in output) or (attack.at_once and not output):
            return output[0] if output else f"blocked {stop}"
        if attack.at_once:
            targets = targets | {"other": int(output[-1].removeprefix("ready "))}
        else:
            first.close()
        with sandboxes.open_private_folder() as folder:
            output, stop = run_text(sandboxes, role, _text(find, attack, targets), folder)
    return output[-1] if output else f"blocked {stop}"


def run_text(sandboxes: Sandboxes, role: ChildRole, text: str, folder: Path) -> tuple[list[str], ChildStopped | None]:
    """Run a student's file; return the texts it printed, and how it was stopped, if it was."""
    with _running(sandboxes, role, text, folder) as child:
        return _heard(child, role)


@contextlib.contextmanager
def _running(sandboxes: Sandboxes, role: ChildRole, text: str, folder: Path) -> Iterator[ServedChild]:
    child = sandboxes.spawn(role, LIMITS, folder)
    try:
        job = {"name": f"{role}.py", "text": text, "seed": 1}
        child.send(
            job
            | (
                {"preamble": "none", "sensors": {}, "modules": {}, "tick": TICK}
                if role.startswith("robot")
                else {"function": None}
            )
        )
        yield child
    finally:
        child.close()


def _heard(child: ServedChild, role: ChildRole, until: str | None = None) -> tuple[list[str], ChildStopped | None]:
    """Return the texts that a child prints, up to its end or to a text that begins with ``until``."""
    output: list[str] = []
    try:
        while True:
            frame = child.receive(SCHEMAS[role.removesuffix(" with libraries")])
            if frame["do"] == "print":
                output.append(frame["text"])
                if until is not None and frame["text"].startswith(until):
                    return output, None
            elif frame["do"] in ("end", "ready"):
                return output + ([json.dumps(frame["error"])] if frame["error"] else []), None
    except ChildStopped as stop:
        return output, stop
    except KilledFromOutside:
        return output, ChildStopped(Verdict.HOST_ERROR, "SIGKILL")
    except LibrariesNeeded as needed:
        return output, ChildStopped(Verdict.SANDBOX_VIOLATION, str(needed))


@contextlib.contextmanager
def decoys(home: Path, victim: Victim) -> Iterator[Decoys]:
    made = Decoys(home, victim)
    try:
        yield made
    finally:
        made.close()


def _without_powers() -> None:
    """Drop all privileges, as in the child, so that only the sandbox separates the two."""
    lockdown.forbid_new_privileges()
    lockdown.drop_capabilities()


def _server(family: int, kind: int, address: Any) -> socket.socket:
    server = socket.socket(family, kind)
    server.setblocking(False)
    server.bind(address)
    if kind == socket.SOCK_STREAM:
        server.listen()
    return server


def _reached(server: socket.socket) -> bool:
    try:
        if server.type == socket.SOCK_STREAM:
            server.accept()[0].close()
        else:
            server.recv(100)
    except BlockingIOError:
        return False
    return True
