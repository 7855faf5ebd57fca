"""Reference responders as text: submissions that work, and files that an assignment gives by their names.

Each file of this folder is one, written as students write them, and run inside the sandbox; nothing here imports one.
"""

from importlib import resources
from importlib.resources.abc import Traversable


def names() -> tuple[str, ...]:
    """The names of the files, sorted."""
    return tuple(sorted(_files()))


def source(name: str) -> str:
    """The text of a reference responder. Raises KeyError for a name that is not in ``names()``."""
    return _files()[name].read_text(encoding="utf-8")


def _files() -> dict[str, Traversable]:
    return {
        file.name: file
        for file in resources.files(__package__).iterdir()
        if file.name.endswith(".py") and not file.name.startswith("_")
    }
