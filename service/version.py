"""Which Robomark grades: the version that reports name, and a hash of everything that decides over marks."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator
from functools import cache
from importlib.metadata import version
from pathlib import Path

GRADER_VERSION = version("robomark")

_PACKAGES = Path(__file__).parent.parent
#: What the marks follow from; an assignment has a hash of its own.
_DECIDING = ("sim", "models", "responders", "submissions", "service/grading")
_NOT_DECIDING = {"__pycache__", "catalogue", "examples"}
_DISTRIBUTIONS = ("pybullet", "numpy", "scikit-learn", "joblib", "pandas", "pillow", "google-re2")


@cache
def grader_sha256() -> str:
    """Hash of the grading code, its data and the libraries it stands on: where it is the same, marks are too."""
    digest = hashlib.sha256(platform.python_version().encode())
    for name in _DISTRIBUTIONS:
        digest.update(f"{name} {version(name)}\n".encode())
    for path in _files():
        data = path.read_bytes()
        digest.update(f"{path.relative_to(_PACKAGES)}:{len(data)}:".encode() + data)
    return digest.hexdigest()


def _files() -> Iterator[Path]:
    for room in _DECIDING:
        for path in sorted((_PACKAGES / room).rglob("*")):
            if path.is_file() and _NOT_DECIDING.isdisjoint(path.relative_to(_PACKAGES).parts):
                yield path
