"""Which Robomark grades: the version that reports name, and a hash of everything that decides over marks."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

GRADER_VERSION = version("robomark")

_PACKAGES = Path(__file__).parent.parent
#: What the marks follow from; an assignment has a hash of its own.
_DECIDING = ("sim", "models", "responders", "submissions", "service/grading")
_NOT_DECIDING = {"__pycache__", "catalogue", "examples"}
#: Every library that the deciding code imports, and those that these compute with.
_DISTRIBUTIONS = (
    *("pybullet", "numpy", "scipy", "scikit-learn", "joblib", "threadpoolctl", "pandas", "pillow", "google-re2"),
    *("onnxruntime", "ai-edge-litert", "pydantic", "pydantic-core", "pyyaml"),
)


def release_problem() -> str:
    """Why this process must be restarted: the installed release is not the one that runs. Empty where it is."""
    installed = _version("robomark")
    if installed == GRADER_VERSION:
        return ""
    return f"another release ({installed}) is installed than the one that runs ({GRADER_VERSION}); restart"


@cache
def grader_sha256() -> str:
    """Hash of the grading code, its data and the libraries it stands on: where it is the same, marks are too."""
    digest = hashlib.sha256(platform.python_version().encode())
    for name in _DISTRIBUTIONS:
        digest.update(f"{name} {_version(name)}\n".encode())
    for path in _files():
        data = path.read_bytes()
        digest.update(f"{path.relative_to(_PACKAGES)}:{len(data)}:".encode() + data)
    return digest.hexdigest()


def _version(distribution: str) -> str:
    """The version that is installed now; "none" for a library that is not."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "none"


def _files() -> Iterator[Path]:
    for room in _DECIDING:
        for path in sorted((_PACKAGES / room).rglob("*")):
            if path.is_file() and _NOT_DECIDING.isdisjoint(path.relative_to(_PACKAGES).parts):
                yield path
