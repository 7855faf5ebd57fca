"""Comparison of the installed files with the record of the installation.

Another distribution may contain a ``models/`` folder, too, and replace files of this one.
"""

from __future__ import annotations

import base64
import hashlib
from importlib import metadata
from pathlib import Path

from service.settings import Settings

#: Packages of the distribution, next to its metadata.
_PACKAGES = frozenset({"robomark", "sim", "models", "responders", "submissions", "service"})


def check_installed_files(_settings: Settings) -> tuple[bool, str]:
    """Return whether the installed files are unchanged, and a sentence."""
    recorded_files = [file for file in metadata.files("robomark") or () if file.hash is not None]
    own_files = [file for file in recorded_files if file.parts[0] in _PACKAGES]
    if not own_files:
        return True, "an editable installation, so its files cannot be compared with a record"
    changes = sorted(str(file) for file in own_files if not _is_unchanged(file))
    if not changes:
        return True, f"{len(own_files)} files are unchanged since installation"
    other_changes = f" and {len(changes) - 1} more" if len(changes) > 1 else ""
    return (
        False,
        f"{changes[0]}{other_changes} changed since installation, perhaps by another package: install robomark again",
    )


def _is_unchanged(file: metadata.PackagePath) -> bool:
    assert file.hash is not None
    try:
        data = Path(str(file.locate())).read_bytes()
    except OSError:
        return False
    digest = base64.urlsafe_b64encode(hashlib.new(file.hash.mode, data).digest())
    return digest.rstrip(b"=").decode() == file.hash.value
