"""``doctor`` notices one of our files that another distribution has replaced."""

from __future__ import annotations

import base64
import hashlib
from importlib import metadata
from pathlib import Path

import pytest

from service import installed_files
from service.settings import Settings


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an installation of two files with a record, as a wheel leaves it."""
    lines = []
    for name, data in (("models/__init__.py", b"ours\n"), ("sim/world.py", b"ours as well\n")):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_bytes(data)
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(data)}")
    info = tmp_path / "robomark-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: robomark\nVersion: 1\n")
    (info / "RECORD").write_text("\n".join([*lines, "robomark-1.dist-info/RECORD,,", ""]))
    distribution = metadata.PathDistribution(info)
    monkeypatch.setattr("importlib.metadata.files", lambda _name: distribution.files)
    return tmp_path


def test_files_as_recorded_are_well(installed: Path) -> None:
    assert installed_files.check_installed_files(Settings(home=installed)) == (
        True,
        "2 files are unchanged since installation",
    )


@pytest.mark.parametrize("name", ["models/__init__.py", "sim/world.py"])
@pytest.mark.parametrize("is_removed", [False, True])
def test_a_file_that_another_package_replaced_is_named(installed: Path, name: str, is_removed: bool) -> None:
    if is_removed:
        (installed / name).unlink()
    else:
        (installed / name).write_text("theirs\n")
    well, sentence = installed_files.check_installed_files(Settings(home=installed))
    assert (well, name in sentence) == (False, True)


def test_an_editable_installation_says_that_it_has_no_record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("importlib.metadata.files", lambda _name: [])
    assert installed_files.check_installed_files(Settings(home=tmp_path))[0]
