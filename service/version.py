"""Version of the grader: the release named in reports, and a hash of everything that affects marks."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from sim.sentences import Sentence

GRADER_VERSION = version("robomark")

_ROOT = Path(__file__).parent.parent
#: Code and data that affect marks; assignments have their own hash.
_GRADER_FOLDERS = ("sim", "models", "responders", "submissions", "service/grading")
_IGNORED_NAMES = {"__pycache__", "catalogue", "examples"}
#: Libraries imported by that code, and the libraries that these compute with.
_DISTRIBUTIONS = (
    *("pybullet", "numpy", "scipy", "scikit-learn", "joblib", "threadpoolctl", "pandas", "pillow", "google-re2"),
    *("onnxruntime", "ai-edge-litert", "pydantic", "pydantic-core", "pyyaml"),
)


def describe_release_problem() -> str:
    """Return the reason why this process must be restarted: a different release is installed.

    Empty if there is none.
    """
    installed_version = _find_version("robomark")
    if installed_version == GRADER_VERSION:
        return ""
    return Sentence(
        "the installed release (%(installed)s) differs from the running one (%(running)s); restart",
        installed=installed_version,
        running=GRADER_VERSION,
    )


@cache
def hash_grader() -> str:
    """Return the hash of the grading code, its data and libraries. Equal hashes mean equal marks."""
    digest = hashlib.sha256(platform.python_version().encode())
    for name in _DISTRIBUTIONS:
        digest.update(f"{name} {_find_version(name)}\n".encode())
    for path in _list_grader_files():
        data = path.read_bytes()
        digest.update(f"{path.relative_to(_ROOT)}:{len(data)}:".encode() + data)
    return digest.hexdigest()


def _find_version(distribution: str) -> str:
    """Return the version that is installed now; "none" for a missing library."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "none"


def _list_grader_files() -> Iterator[Path]:
    for folder in _GRADER_FOLDERS:
        for path in sorted((_ROOT / folder).rglob("*")):
            if path.is_file() and _IGNORED_NAMES.isdisjoint(path.relative_to(_ROOT).parts):
                yield path
