"""Locations of assignments: the catalogue, and the folder for a name or path.

This module opens no files; ``reader.py`` reads them.
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

from sim.errors import UsageError
from submissions.suggestions import suggest_name

FILE_NAME = "assignment.toml"
#: The example that must get full marks.
REFERENCE = "reference"


def list_catalogue_ids() -> tuple[str, ...]:
    """Return the ids of the packaged assignments, sorted."""
    return tuple(sorted(folder.name for folder in _locate_catalogue().iterdir() if (folder / FILE_NAME).is_file()))


def locate_assignment_folder(name_or_path: str | os.PathLike[str]) -> Path:
    """Return the folder of the catalogue assignment with this id, or this folder itself.

    Raises:
        UsageError: Neither exists.
    """
    name = os.fspath(name_or_path)
    try:
        folder = _find_folder(name)
    except PermissionError as error:
        raise UsageError(f"{name[:200]} cannot be read: {error.strerror}") from error
    except OSError:  # the name is too long for a file, for example
        folder = None
    if folder is not None:
        return folder
    hint = suggest_name(name, list_catalogue_ids()) or "; robomark assignments list shows the catalogue"
    raise UsageError(f"There is no assignment {name[:200]!r}, expected an id of the catalogue or a folder{hint}")


def _find_folder(name: str) -> Path | None:
    path = Path(name)
    catalogue_folder = _locate_catalogue() / name
    if path.name == name and (catalogue_folder / FILE_NAME).is_file():
        return catalogue_folder
    if path.name == FILE_NAME and path.is_file():
        path = path.parent
    if path.is_dir():
        return path
    if path.is_file():
        raise UsageError(f"{name} is a file, expected an id of the catalogue or a folder with {FILE_NAME} in it")
    return None


def _locate_catalogue() -> Path:
    return Path(str(resources.files("submissions"))) / "catalogue"
