"""Secrets in the usual places of a worker: none appears in any result, and no student sees another student's.

Each search is proved to work: without the sandbox, or in the process that has the secret, it finds it.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from attacks import memory
from battery import attack_text, attacks, scrambled
from running import run_program
from service.grading.trial_runner import TrialRunner
from sim.recording import Recording

#: A sentence from one of the grader's own files.
_OF_THE_PACKAGE = "Judging: from recordings to marks"
_SECRETS = {place: f"decoy-of-the-{place}-7f3a" for place in ("environment", "memory", "file")}
_HELD = [_SECRETS["memory"]]

#: Opens files with the C library, so that only the kernel can refuse, and reports the content in every possible way.
_SEARCH = """
import ctypes, gc, os, sys
libc = ctypes.CDLL(None)

def read(path):
    fd = libc.open(path.encode(), 0)
    return os.read(fd, 100_000).decode("latin-1") if fd >= 0 else ""

def search():
    yield str(dict(os.environ))
    for path in {paths!r}:
        yield read(path)
    for found in gc.get_objects():
        if isinstance(found, (dict, list, tuple)):
            for each in (found.values() if isinstance(found, dict) else found):
                if isinstance(each, (str, bytes)):
                    yield str(each)

def tell():
    for text in search():
        for code in {codes!r}:
            secret = "".join(chr(byte ^ 0x5A) for byte in bytes.fromhex(code))
            if secret in text:
                print(secret)
                raise RuntimeError(secret)
"""
_LAST = "decoy-of-the-last-student"


def _search(paths: list[str], *secrets: str) -> str:
    """Return a student's search for ``secrets``, which are scrambled so that the search does not find itself."""
    return _SEARCH.replace("{paths!r}", repr(paths)).replace("{codes!r}", repr(scrambled(*secrets)))


def _everything(recording: Recording) -> bytes:
    return pickle.dumps(recording)


@pytest.fixture
def paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the paths of secrets in files. The secret in the environment is set before any process starts."""
    monkeypatch.setenv("ROBOMARK_SELF_TEST", _SECRETS["environment"])
    secret = tmp_path / "secret"
    secret.write_text(_SECRETS["file"])
    secret.chmod(0o600)
    module = tmp_path / "module.py"
    module.write_text(f'"""{_OF_THE_PACKAGE}."""\n')
    return [str(secret), str(module), "/proc/self/environ"]


@pytest.mark.parametrize("secret", [_SECRETS["file"], _SECRETS["environment"], _OF_THE_PACKAGE])
def test_the_search_finds_what_no_sandbox_hides(secret: str, paths: list[str]) -> None:
    """Runs outside the sandbox, as an ordinary program."""
    ran = subprocess.run(
        [sys.executable, "-I", "-c", _search(paths, secret) + "\ntell()"], capture_output=True, text=True, check=False
    )
    assert secret in ran.stdout
    assert secret in ran.stderr


def test_no_secret_is_in_anything_that_comes_back(paths: list[str]) -> None:
    search = _search(paths, *_SECRETS.values(), _OF_THE_PACKAGE)
    responder = search + "\ndef responder(text):\n    tell()\n    return str(dict(os.environ))\n"
    with TrialRunner() as runner:
        recording = run_program(runner, search + '\nprint("PY::hello")\ntell()\n', responder=responder)
        assert len(recording.messages) == 2, recording.faults
        assert recording.faults == ()
        came_back = _everything(recording)
    for secret in (*_SECRETS.values(), _OF_THE_PACKAGE):
        assert secret.encode() not in came_back


@pytest.mark.long
@pytest.mark.parametrize("role", ["program", "responder"])
def test_the_next_student_sees_nothing_of_the_last(role: str) -> None:
    """The first student leaves a mark in memory, in modules, in built-in functions and in files."""
    leave = """
import builtins, json, sys
mark = "decoy-of-the-last-" + "student".lower()
builtins.left_here = mark
json.loads = lambda text: mark
sys.left_here = sys.modules["left_here"] = mark
sys.meta_path.insert(0, mark)
held = [mark * 1000 for _ in range(1000)]
"""
    look = (
        _search([])
        + """
import builtins, json, os, sys
print("seen", hasattr(builtins, "left_here"), hasattr(sys, "left_here"), "left_here" in sys.modules)
print("seen", json.loads("1") == 1, any(isinstance(each, str) for each in sys.meta_path))
try: print("seen", sorted(os.listdir(".")))
except OSError: pass
tell()
"""
    )
    write = 'open("left.txt", "w").write(mark)\n'
    answer = "def responder(text): return text\n"
    with TrialRunner() as runner:
        for _ in range(2):
            if role == "program":
                first = run_program(runner, _search([], _LAST) + leave + "tell()\n")
                second = run_program(runner, look)
                page_text = [line.text for line in second.printed]
            else:
                first = run_program(runner, "pass", responder=_search([], _LAST) + leave + write + "tell()\n" + answer)
                second = run_program(runner, 'print("PY::x")', responder=look + answer)
                page_text = second.responder_output.splitlines()
                assert page_text.pop(2) == "seen []"
            assert _LAST.encode() in _everything(first)
            assert page_text == ["seen False False False", "seen True False"]
            assert second.faults == ()


@pytest.mark.parametrize("name", ["walk_all_objects", "find_secrets_in_the_environment"])
def test_forked_from_the_worker_a_child_would_find_its_secrets(name: str) -> None:
    """The reason for zygotes: the same attacks succeed in a plain fork of a process that has a secret."""
    attack = next(each for each in attacks() if each.name == name)
    targets = {"scrambled": scrambled(_SECRETS["memory"], _SECRETS["environment"])}
    held = f"import os\nheld = [{_SECRETS['memory']!r}]\nif os.fork():\n    os.wait()\n    os._exit(0)\n"
    ran = subprocess.run(
        [sys.executable, "-I", "-c", held + attack_text(attack, targets)],
        capture_output=True,
        text=True,
        check=True,
        env={"DECOY": _SECRETS["environment"]},
    )
    assert "LEAK" in ran.stdout
    assert memory.__name__.endswith(attack.group)
