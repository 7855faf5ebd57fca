"""File names that every operating system can create."""

from __future__ import annotations

import re

#: Windows reserves these names in every folder, with any ending and in any case.
_RESERVED = re.compile(r"(?:con|prn|aux|nul|conin\$|conout\$|(?:com|lpt)[0-9¹²³]) *(?=\.|\Z)", re.IGNORECASE)


def make_portable_name(name: str) -> str:
    """Return the name with a ``~`` before its first point if Windows reserves it: ``CON.txt`` becomes ``CON~.txt``.

    Different stems of ``service.reports.output_files`` stay different, because none ends in ``~``.
    """
    reserved = _RESERVED.match(name)
    return name if reserved is None else f"{name[: reserved.end()]}~{name[reserved.end() :]}"
