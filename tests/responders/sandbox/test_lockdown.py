"""Each layer alone, around a bare process: the effect of a rule, the privileges root loses, the child's user."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from battery import SYSTEM_PYTHON, run_text
from responders.sandbox import manager
from responders.sandbox.inside import grants
from responders.sandbox.isolation import NO_ISOLATION, Isolation
from responders.sandbox.manager import Sandboxes

_SANDBOX = Path(manager.__file__).parent

#: Ways to change a readable file; each has a separate file.
_CHANGES = {
    "reading-truncating": "os.open(path, os.O_RDONLY | os.O_TRUNC)",
    "neither-truncating": "os.open(path, 3 | os.O_TRUNC)",
    "neither-truncating-creating": "os.open(path, 3 | os.O_TRUNC | os.O_CREAT, 0o600)",
    "writing": "os.write(os.open(path, os.O_WRONLY), b'mine')",
    "truncate": "os.truncate(path, 0)",
    "mapping": "mmap.mmap(os.open(path, os.O_RDWR), 4)",
    "removing": "os.unlink(path)",
    "renaming": "os.rename(path, path + '-mine')",
    "reading-and-truncating-the-descriptor": "os.ftruncate(os.open(path, os.O_RDONLY), 0)",
}
_PROBE = """
import json, mmap, os, sys
sys.path.insert(0, sys.argv[1])
from inside import lockdown
folder, landlock, seccomp, changes = sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), json.loads(sys.argv[5])
lockdown.drop_capabilities()
lockdown.forbid_new_privileges()
if landlock:
    lockdown.restrict_files(lockdown.build_reading_rules(lockdown.Grants((folder,))), landlock)
if seccomp:
    lockdown.restrict_system_calls()
for name, change in changes.items():
    path = os.path.join(folder, name)
    os.close(os.open(path, os.O_RDONLY))
    try:
        eval(change)
    except OSError:
        pass
"""


@pytest.mark.parametrize(
    ("landlock", "seccomp", "changed"),
    [
        (99, True, set()),
        (1, True, set()),
        (1, False, {"reading-truncating", "neither-truncating", "neither-truncating-creating", "truncate"}),
        (0, False, set(_CHANGES) - {"reading-and-truncating-the-descriptor"}),
    ],
)
def test_a_file_that_may_be_read_may_not_be_changed(
    landlock: int, seccomp: bool, changed: set[str], tmp_path: Path
) -> None:
    for name in _CHANGES:
        (tmp_path / name).write_text("given")
    subprocess.run(
        [
            sys.executable,
            "-I",
            "-c",
            _PROBE,
            _SANDBOX,
            tmp_path,
            str(landlock),
            str(int(seccomp)),
            json.dumps(_CHANGES),
        ],
        check=True,
    )
    document = {name for name in _CHANGES if not (tmp_path / name).exists() or (tmp_path / name).read_text() != "given"}
    assert document | {"mapping"} == changed | {"mapping"}


def test_no_powers_are_left() -> None:
    text = """
import ctypes
sets = ctypes.create_string_buffer(24)
print(ctypes.CDLL(None).syscall(125, (0x20080522).to_bytes(8, "little"), sets), sets.raw == bytes(24))
"""
    with Sandboxes(NO_ISOLATION) as sandboxes, sandboxes.open_private_folder() as folder:
        assert run_text(sandboxes, "robot", text, folder) == (["0 True"], None)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
@pytest.mark.skipif(not Path(SYSTEM_PYTHON).exists(), reason="needs an interpreter that others can read")
@pytest.mark.parametrize("bubblewrap", [False, True])
def test_root_makes_each_child_a_user_of_its_own(bubblewrap: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the interpreter is in a folder of root's, the children remain root, but without root's privileges."""
    monkeypatch.setattr(sys, "executable", SYSTEM_PYTHON)
    text = """
import os, wave
print(os.getuid(), os.geteuid(), os.getgid(), os.getegid())
print(open("given.txt").read())
open("logger.txt", "w").write("mine")
"""
    with Sandboxes(Isolation(bubblewrap=bubblewrap)) as sandboxes, sandboxes.open_private_folder() as folder:
        stamp = sandboxes.check_isolation()
        (folder / "given.txt").write_text("given")
        (folder / "given.txt").chmod(0o600)
        output, stop = run_text(sandboxes, "robot", text, folder)
        assert (folder / "logger.txt").read_text() == "mine"
    assert "own user, " in stamp
    assert (stop, output[1]) == (None, "given")
    assert all(61_000 <= int(number) < 65_000 for number in output[0].split())


def test_a_folder_that_others_cannot_enter_is_not_open_to_them() -> None:
    with tempfile.TemporaryDirectory() as made:
        outer, inner = Path(made), Path(made) / "inner"
        inner.mkdir()
        module = inner / "module.py"
        module.touch()
        for path in (outer, inner, module):
            path.chmod(0o755)
        assert grants.is_open_to_others((str(module), str(inner), str(inner / "missing.py")))
        for path in (outer, module):
            path.chmod(0o700)
            assert not grants.is_open_to_others((str(module), str(inner)))
            path.chmod(0o755)
