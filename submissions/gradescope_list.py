"""Reader of the list of submissions in a Gradescope export, which is YAML written by Ruby.

``downloads.py`` finds the students.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sim.errors import UsageError
from sim.readers.reader_errors import UnreadableDataError
from sim.readers.yaml_text import MAX_BYTES, read_yaml


def read_gradescope_list(path: Path) -> dict[str, Any]:
    """Return the submissions by folder. All values are texts; YAML tags and merge keys have no effect.

    Raises:
        UsageError: The file is not such a list.
    """
    try:
        with path.open("rb") as stream:
            submissions = read_yaml(stream.read(MAX_BYTES + 1))
    except OSError as error:
        raise UsageError(f"{path.name}: cannot be read: {error.strerror}.") from None
    except UnreadableDataError as error:
        raise UsageError(f"{path.name}: cannot be read: {error}, expected the file exported from Gradescope.") from None
    if not isinstance(submissions, dict):
        raise UsageError(f"{path.name}: is not a list of submissions, expected the file exported from Gradescope.")
    return {name: own for name, own in submissions.items() if isinstance(name, str)}
