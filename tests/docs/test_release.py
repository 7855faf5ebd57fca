"""A release is refused until all conditions are met, and a dry run leaves only the built files."""

from __future__ import annotations

import subprocess
import tarfile
import zipfile
from datetime import UTC, date, datetime
from pathlib import Path

import pytest

from deploy import release
from deploy.release import NotReady
from paths import ROOT

TODAY = date(2026, 11, 25)
GOOD = "# Changes\n\n## 0.3.0 – 2026-11-25\n\nNew.\n\n## 0.2.0 – 2026-11-22\n"
PYPROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "robomark"
version = "0.3.0"

[tool.hatch.build.targets.wheel]
packages = ["robomark"]
"""


def _git(folder: Path, *words: str) -> str:
    who = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org"]
    return subprocess.run(["git", *who, *words], cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return a checkout of a small distribution that can be released."""
    folder = tmp_path / "tree"
    (folder / "robomark").mkdir(parents=True)
    (folder / "robomark" / "__init__.py").write_text('"""Grades."""\n')
    (folder / "pyproject.toml").write_text(PYPROJECT)
    (folder / "CHANGELOG.md").write_text(GOOD)
    (folder / ".gitignore").write_text("dist/\n")
    (folder / "Makefile").write_text("lint test-fast:\n\t@true\n")
    _git(folder, "init", "--quiet")
    _commit(folder)
    return folder


def _commit(folder: Path) -> None:
    _git(folder, "add", "--all")
    _git(folder, "commit", "--quiet", "--message", "Changes")


def test_a_dry_run_builds_and_sets_no_tag(tree: Path) -> None:
    wheel, archive = sorted(release.release(tree, is_dry_run=True), key=lambda file: file.suffix, reverse=True)
    with zipfile.ZipFile(wheel) as opened:
        assert "robomark/__init__.py" in opened.namelist()
    with tarfile.open(archive) as sources:
        assert "robomark-0.3.0/robomark/__init__.py" in sources.getnames()
    assert _git(tree, "tag") == ""
    assert _git(tree, "status", "--porcelain") == ""


def test_a_release_sets_a_tag_once(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(release, "build_image", lambda _root: None)
    monkeypatch.setenv("GIT_COMMITTER_NAME", "Ada")
    monkeypatch.setenv("GIT_COMMITTER_EMAIL", "ada@example.org")
    release.release(tree, is_dry_run=False)
    assert _git(tree, "rev-parse", "v0.3.0^{commit}") == _git(tree, "rev-parse", "HEAD")
    with pytest.raises(NotReady, match=r"v0\.3\.0 is a tag already"):
        release.release(tree, is_dry_run=False)


def test_a_tree_with_changes_is_refused(tree: Path) -> None:
    (tree / "new.py").touch()
    with pytest.raises(NotReady, match=r"new\.py"):
        release.release(tree, is_dry_run=True)


@pytest.mark.parametrize("target", ["lint", "test-fast"])
def test_a_check_that_fails_stops_the_release(tree: Path, target: str) -> None:
    other = {"lint": "test-fast", "test-fast": "lint"}[target]
    (tree / "Makefile").write_text(f"{other}:\n\t@true\n{target}:\n\t@false\n")
    _commit(tree)
    with pytest.raises(NotReady, match=f"make {target} fails"):
        release.release(tree, is_dry_run=True)


def test_a_wheel_without_a_committed_file_is_refused(tree: Path) -> None:
    (tree / ".gitignore").write_text("dist/\n*.toml\n")
    (tree / "robomark" / "task.toml").touch()
    _git(tree, "add", "--force", "robomark/task.toml")
    _commit(tree)
    with pytest.raises(NotReady, match=r"robomark/task\.toml"):
        release.release(tree, is_dry_run=True)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (GOOD.replace("0.3.0", "0.4.0"), "the first section"),
        ("## Unreleased\n\n" + GOOD, "the first section"),
        (GOOD.replace(" – 2026-11-25", ""), r"no date for 0\.3\.0"),
        (GOOD.replace(" – 2026-11-22", ""), r"no date for 0\.2\.0"),
        (GOOD.replace("2026-11-25", "2026-11-26"), "in the future"),
        (GOOD.replace("2026-11-22", "2026-12-22"), "not in order"),
        ("", "the first section"),
    ],
)
def test_a_changelog_without_the_version_and_its_date_is_refused(text: str, reason: str) -> None:
    release.check_changelog(GOOD, "0.3.0", TODAY)
    with pytest.raises(NotReady, match=reason):
        release.check_changelog(text, "0.3.0", TODAY)


def test_the_changelog_names_this_version_with_its_date() -> None:
    text, version = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), release.version_of(ROOT)
    sections = [each["version"] for each in release._HEADING.finditer(text)]
    if sections[0] != "Unreleased":
        release.check_changelog(text, version, datetime.now(UTC).date())
    assert version in sections[:2]
