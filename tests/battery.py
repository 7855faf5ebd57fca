"""Runs attacks inside a child, against canaries made for each: files, a process and servers that nobody needs.

What an attack says of itself is one half of the evidence; the canaries, looked at afterwards from outside, the other.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from attacks import file_changes, files, kernel, memory, metadata, network, processes, programs, signals, tools
from filter_machine import listed
from responders import wire
from responders.sandbox.inside import lockdown
from responders.sandbox.manager import NONE, Role, Sandboxes, Walls
from responders.sandbox.meter import ChildStopped
from responders.sandbox.running_child import ChildLimits

GROUPS = (files, file_changes, metadata, processes, signals, programs, network, kernel, memory)
LIMITS = ChildLimits(4.0, 256 << 20)

#: The settings in which an attack must get through, by what stops it: otherwise its test would prove nothing.
GETS_THROUGH = {
    tools.LANDLOCK: frozenset({"none", "seccomp"}),
    tools.SECCOMP: frozenset({"none", "landlock", "landlock-1"}),
    tools.EITHER: frozenset({"none"}),
    tools.NEWER: frozenset({"none", "landlock-1"}),
    tools.REMAINS: frozenset({"none", "full", "full-1"}),
    tools.UNTRIED: frozenset(),
}
SETTINGS = {
    "full": Walls(bubblewrap=False),
    "full-1": Walls(landlock=1, bubblewrap=False),
    "bubblewrap": Walls(),
    "none": NONE,
    "landlock": Walls(seccomp=False, bubblewrap=False),
    "landlock-1": Walls(landlock=1, seccomp=False, bubblewrap=False),
    "seccomp": Walls(landlock=0, bubblewrap=False),
}
#: An interpreter that every user can read, where the machine has one.
SYSTEM_PYTHON = "/usr/bin/python3.11"
#: In the worker's environment and memory while attacks run.
SECRET = "canary-of-the-worker-51c9"
SCHEMAS = {"robot": wire.ROBOT, "responder": wire.RESPONDER}
_TOOLS = Path(tools.__file__).read_text()
_NUMBERS = {name: number for number, name, _ in listed()}

#: The first lines of the student's file: this file's ``tools`` under their own name, then the group and the attack.
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
tools.report(getattr(module("group", {group!r}), {name!r}))
def responder(text): return text
"""


@dataclass(frozen=True)
class Attack:
    """One attack: its group, its name, and which wall stops it."""

    group: str
    name: str
    stopped_by: str
    text: str = field(repr=False)

    @property
    def id(self) -> str:
        return f"{self.group}-{self.name}"


def attacks() -> list[Attack]:
    """All of them, in the order of their files."""
    return [
        Attack(group.__name__.rpartition(".")[2], name, value.stopped_by, Path(group.__file__ or "").read_text())
        for group in GROUPS
        for name, value in vars(group).items()
        if hasattr(value, "stopped_by")
    ]


class Victim:
    """A process that sleeps with a secret; started again when something has happened to it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def fresh(self) -> subprocess.Popen[bytes]:
        """It, alive and as it was made."""
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


class Canaries:
    """A folder with secrets, a process, and servers: all that attacks are aimed at."""

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
        """What has changed since they were made, as sentences."""
        found = [f"{name} is now {after}" for name, after in self._look().items() if self._before[name] != after]
        return found + [f"{server.getsockname()!r} was reached" for server in self._servers if _reached(server)]

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


def attack_text(attack: Attack, targets: dict[str, Any]) -> str:
    """A student's file that runs an attack and prints what came of it."""
    return _FRAME.format(tools=_TOOLS, numbers=_NUMBERS, targets=targets, group=attack.text, name=attack.name)


def scrambled(*secrets: str) -> list[str]:
    """Secrets in a form that does not hold them, for an attack that looks for them."""
    return [bytes(byte ^ 0x5A for byte in secret.encode()).hex() for secret in secrets]


def run(sandboxes: Sandboxes, role: Role, attack: Attack, targets: dict[str, Any]) -> str:
    """What came of an attack in a folder of its own: ``LEAK ...``, or how it was blocked."""
    with sandboxes.private_folder() as folder:
        said, stop = run_text(sandboxes, role, attack_text(attack, targets), folder)
    leaks = [line for line in said if line.startswith("LEAK")]
    if leaks:
        return leaks[0]
    if stop is not None and any(words in stop.message for words in ("not JSON", "without its number")):
        return f"LEAK another program wrote on the wire ({stop.message})"
    return stop.message if stop is not None else "\n".join(said)


def run_text(sandboxes: Sandboxes, role: Role, text: str, folder: Path) -> tuple[list[str], ChildStopped | None]:
    """Run a student's file; the texts it printed, and how it was stopped if it was."""
    said: list[str] = []
    child = sandboxes.spawn(role, LIMITS, folder)
    try:
        job = {"name": f"{role}.py", "text": text, "seed": 1}
        child.send(job | ({"preamble": "none"} if role == "robot" else {"function": None}))
        while True:
            frame = child.receive(SCHEMAS[role])
            if frame["do"] == "print":
                said.append(frame["text"])
            elif frame["do"] in ("end", "ready"):
                return said + ([json.dumps(frame["error"])] if frame["error"] else []), None
    except ChildStopped as stop:
        return said, stop
    finally:
        child.close()


@contextlib.contextmanager
def canaries(home: Path, victim: Victim) -> Iterator[Canaries]:
    made = Canaries(home, victim)
    try:
        yield made
    finally:
        made.close()


def _without_powers() -> None:
    """As weak as the child, so that only the walls keep the one from the other."""
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
