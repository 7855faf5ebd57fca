"""Reference responders as text: correct submissions, and files that assignments refer to by name.

Each file of this folder is one, written as students write them, and run inside the sandbox; nothing here imports one.
"""

from importlib import resources
from importlib.resources.abc import Traversable


def names() -> tuple[str, ...]:
    """Return the sorted names of the files."""
    return tuple(sorted(_files()))


def source(name: str) -> str:
    """Return the text of a reference responder. Raises KeyError for a name that is not in ``names()``."""
    return _files()[name].read_text(encoding="utf-8")


def _files() -> dict[str, Traversable]:
    return {
        file.name: file
        for file in resources.files(__package__).iterdir()
        if file.name.endswith(".py") and not file.name.startswith("_")
    }
