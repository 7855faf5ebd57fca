"""Files of the log's head, for an office outside the installation: the signed head, and the newest leaf hashes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from service.statements.envelopes import Envelope, parse_envelope
from service.statements.merkle_tree import compute_root
from service.statements.statement import PredicateType, parse_statement
from sim.errors import UsageError
from sim.readers.json_text import JSONDecodeError, read_json

#: Version of the format, and the limits of a file that is read.
FORMAT = 1
MAX_FILE_BYTES = 256_000_000
_MAX_LEAVES = 3_000_000


@dataclass(frozen=True, slots=True)
class FiledHead:
    """A signed head of the log, with the leaf hashes of the entries from ``start`` to before ``size``.

    ``issued_at`` is the time as in statements.
    """

    envelope: Envelope
    size: int
    root: bytes
    issued_at: str
    start: int
    leaves: tuple[bytes, ...]

    def to_bytes(self) -> bytes:
        """Return the file as JSON."""
        document = {
            "robomark_log_head": FORMAT,
            "head": self.envelope.to_json(),
            "start": self.start,
            "leaves": [leaf.hex() for leaf in self.leaves],
        }
        return (json.dumps(document, indent=1) + "\n").encode("ascii")


def build_filed_head(envelope: Envelope, start: int, leaves: Sequence[bytes]) -> FiledHead:
    """Return the file of a head; ``leaves`` begin with entry ``start``.

    Raises UsageError if the envelope contains no head.
    """
    statement = parse_statement(envelope)
    size, issued_at = statement.predicate.get("size"), statement.predicate.get("issued_at")
    if (
        statement.predicate_type is not PredicateType.LOG_HEAD
        or type(size) is not int
        or not isinstance(issued_at, str)
    ):
        raise UsageError("the file contains no head of the log")
    try:
        root = bytes.fromhex(statement.subjects["log"])
    except (KeyError, TypeError, ValueError):
        raise UsageError("the head of the log names no root") from None
    if not 0 <= start <= size or len(leaves) != size - start:
        raise UsageError("the file has %(count)s leaves, expected %(size)s", count=len(leaves), size=size - start)
    if start == 0 and compute_root(leaves) != root:
        raise UsageError("the leaves in the file are not those of its signed head: the file was changed")
    return FiledHead(envelope, size, root, issued_at, start, tuple(leaves))


def parse_filed_head(content: bytes) -> FiledHead:
    """Return the head in a file. Raises UsageError if it is no such file, or too large."""
    if len(content) > MAX_FILE_BYTES:
        raise UsageError("the file has more than %(most)s MB", most=MAX_FILE_BYTES // 1_000_000)
    try:
        document: Any = read_json(content, max_values=_MAX_LEAVES)
    except JSONDecodeError:
        raise UsageError("the file is not JSON, expected a head of the log") from None
    if not isinstance(document, dict) or document.get("robomark_log_head") != FORMAT:
        raise UsageError("the file is no head of the log, expected robomark_log_head: %(format)s", format=FORMAT)
    try:
        start, leaves = document["start"], tuple(bytes.fromhex(leaf) for leaf in document["leaves"])
        if type(start) is not int:
            raise TypeError
    except (KeyError, TypeError, ValueError):
        raise UsageError("the file has no leaves, expected hashes in hexadecimal") from None
    return build_filed_head(parse_envelope(document.get("head")), start, leaves)
