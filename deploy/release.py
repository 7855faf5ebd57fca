"""Releases a version: checks the tree and the changelog, builds the wheels and source archive twice, sets the tag.

``make release`` runs it. ``make release-check`` does the same without the tag and the image. It needs git, and builds
the image only if docker or podman is installed.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from datetime import UTC, date, datetime
from pathlib import Path

ROOT = Path(__file__).parent.parent
_HEADING = re.compile(r"^## (?P<version>\S+)(?: – (?P<date>\d{4}-\d\d-\d\d))?$", re.MULTILINE)
#: Checks that must pass before a release. The releaser decides about the long tests.
_CHECKS = ("lint", "test-fast")


class NotReady(Exception):
    """Raised when the tree can't be released; the message says how to fix it."""


def release(root: Path, *, is_dry_run: bool) -> list[Path]:
    """Release the version in ``pyproject.toml`` and return the built files.

    A dry run checks and builds, but sets no tag.

    Raises:
        NotReady: If a check fails.
    """
    check_tree(root)
    version = version_of(root)
    check_changelog((root / "CHANGELOG.md").read_text(encoding="utf-8"), version, datetime.now(UTC).date())
    if _run(root, "git", "tag", "--list", f"v{version}"):
        raise NotReady(f"v{version} is a tag already; set the next version in pyproject.toml")
    run_checks(root)
    built = build_twice(root, root / "dist")
    check_wheel(root, next(each for each in built if each.suffix == ".whl"), version)
    if not is_dry_run:
        _run(root, "git", "tag", "--annotate", f"v{version}", "--message", f"Robomark {version}")
        build_image(root)
    return built


def version_of(root: Path) -> str:
    """Return the version in ``pyproject.toml``."""
    with (root / "pyproject.toml").open("rb") as source:
        return str(tomllib.load(source)["project"]["version"])


def check_tree(root: Path) -> None:
    """Check that no file is uncommitted or untracked.

    Raises:
        NotReady: If there is one.
    """
    if changed := _run(root, "git", "status", "--porcelain"):
        raise NotReady(f"commit or remove these files first:\n{changed}")


def check_changelog(text: str, version: str, today: date) -> None:
    """Check that the newest section of the changelog has this version, and a date that is not in the future.

    Raises:
        NotReady: If not.
    """
    sections = [(found["version"], found["date"]) for found in _HEADING.finditer(text)]
    if not sections or sections[0][0] != version:
        raise NotReady(f"the first section of CHANGELOG.md has to be '## {version} – {today.isoformat()}'")
    undated = [name for name, day in sections if day is None]
    if undated:
        raise NotReady(f"CHANGELOG.md has no date for {', '.join(undated)}")
    days = [date.fromisoformat(day) for _, day in sections if day is not None]
    if days[0] > today:
        raise NotReady(f"CHANGELOG.md has {days[0]} for {version}, which is in the future")
    if days != sorted(days, reverse=True):
        raise NotReady("the dates in CHANGELOG.md are not in order, the newest first")


def run_checks(root: Path) -> None:
    """Run the linter and the quick tests.

    Raises:
        NotReady: If one fails.
    """
    for target in _CHECKS:
        if subprocess.run(["make", target], cwd=root, stdout=sys.stderr, check=False).returncode:
            raise NotReady(f"make {target} fails")


def build_twice(root: Path, into: Path) -> list[Path]:
    """Build the wheel, the source archive and the notebook's wheel of the last commit in ``into``.

    All are built twice, from copies in two folders.

    Raises:
        NotReady: If the bytes differ.
    """
    with tempfile.TemporaryDirectory(prefix="robomark-release-") as made:
        first, second = (_build(root, Path(made) / name) for name in ("first", "second"))
        if [each.name for each in first] != [each.name for each in second]:
            raise NotReady("two builds of this commit have different files")
        for one, other in zip(first, second, strict=True):
            if one.read_bytes() != other.read_bytes():
                raise NotReady(f"two builds of this commit have a different {one.name}")
        into.mkdir(exist_ok=True)
        return [Path(shutil.copy(each, into)) for each in first]


def check_wheel(root: Path, wheel: Path, version: str) -> None:
    """Check that the wheel has this version and exactly the committed files of its packages.

    Raises:
        NotReady: If not.
    """
    with (root / "pyproject.toml").open("rb") as source:
        packages = tomllib.load(source)["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    committed = set(_run(root, "git", "ls-files", "-z", "--", *packages).split("\0")) - {""}
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        changed = [name for name in names & committed if archive.read(name) != (root / name).read_bytes()]
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        told = archive.read(metadata).decode().splitlines()
    if different := sorted((names ^ committed) | set(changed)):
        raise NotReady(f"{wheel.name} and the committed files differ in {', '.join(different[:20])}")
    if f"Version: {version}" not in told:
        raise NotReady(f"{wheel.name} is not version {version}")


def build_image(root: Path) -> None:
    """Build the container image if a program for it is installed."""
    if shutil.which("docker") is None and shutil.which("podman") is None:
        print("no image: neither docker nor podman is installed", file=sys.stderr)
        return
    subprocess.run(["make", "image"], cwd=root, check=True)


def _build(root: Path, folder: Path) -> list[Path]:
    """Return the files that hatchling builds from a copy of the last commit, with its time as file times."""
    tree, built = folder / "tree", folder / "dist"
    tree.mkdir(parents=True)
    archive = folder / "tree.tar"
    _run(root, "git", "archive", "--output", str(archive), "HEAD")
    shutil.unpack_archive(archive, tree, filter="data")
    environment = os.environ | {"SOURCE_DATE_EPOCH": _run(root, "git", "log", "-1", "--format=%ct")}
    command = [sys.executable, "-m", "hatchling", "build", "--directory", str(built)]
    projects = [(tree, command), (tree / "notebook", [*command, "--target", "wheel"])]
    for project, build in [each for each in projects if each[0].is_dir()]:
        done = subprocess.run(build, cwd=project, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise NotReady(f"the build fails:\n{done.stderr}")
    return sorted(built.iterdir())


def _run(root: Path, *command: str) -> str:
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout.strip()


def main() -> None:
    """Release this checkout. Exits with status 1 if it is not ready."""
    parser = argparse.ArgumentParser(description="Release the version that pyproject.toml names.")
    parser.add_argument("--dry-run", action="store_true", help="check and build, and set no tag")
    is_dry_run = parser.parse_args().dry_run
    try:
        built = release(ROOT, is_dry_run=is_dry_run)
    except NotReady as error:
        sys.exit(f"not released: {error}")
    for file in built:
        print(file.relative_to(ROOT))
    version = version_of(ROOT)
    print(
        f"version {version} can be released"
        if is_dry_run
        else f"version {version} is released: git push origin v{version}"
    )


if __name__ == "__main__":
    main()
