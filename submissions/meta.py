"""submission.toml: what a submission says of itself, read strictly. What follows from it is ``bundle.py``'s."""

from __future__ import annotations

from collections.abc import Mapping

from sim.errors import UsageError
from sim.readers.toml_text import read_toml
from sim.readers.unreadable import Unreadable

META = "submission.toml"
_MAX_BYTES = 64 * 1024


def read_meta(data: bytes, where: str) -> dict[str, object]:
    """What the file says; nothing where there is none. Raises UsageError, naming ``where``, for what cannot be read."""
    if not data:
        return {}
    if len(data) > _MAX_BYTES:
        raise UsageError("%(where)s: %(file)s is too large, expected a few lines.", where=where, file=META)
    return parse_meta(data, where)


def parse_meta(data: bytes, where: str) -> dict[str, object]:
    """The same without a limit of size, for files written here: notes on many files are more than a few lines."""
    try:
        return read_toml(data.decode("utf-8-sig"))
    except ValueError as error:
        problem = error.said if isinstance(error, Unreadable) else str(error)[:200]
        raise UsageError(
            '%(where)s: %(file)s cannot be read (%(problem)s), expected lines like assignment = "echo-responder".',
            where=where,
            file=META,
            problem=problem,
        ) from None


def text_of(meta: Mapping[str, object], key: str, where: str) -> str | None:
    """A text of it, None where it says none. Raises UsageError for anything else."""
    value = meta.get(key)
    if value is not None and (not isinstance(value, str) or not value.strip()):
        raise UsageError(
            '%(where)s: %(key)s in %(file)s is not a text, expected %(key)s = "..." there.',
            where=where,
            key=key,
            file=META,
        )
    return value


def run_of(meta: Mapping[str, object], where: str) -> str | None:
    """Which run of a notebook is to be marked: a number, or the tag of a cell."""
    value = meta.get("run")
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return text_of(meta, "run", where)
