"""The document with the public keys of an installation, which its page shows and ``robomark verify`` reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from service.statements.keys import PublicKey, parse_public_key
from sim.errors import UsageError
from sim.readers.json_text import JSONDecodeError, read_json

#: Version of the format, and the limit of a file that is read.
FORMAT = 1
MAX_FILE_BYTES = 1_000_000


@dataclass(frozen=True, slots=True)
class KeyLine:
    """A public key with its times. The current key signs; a retired or revoked one does not."""

    key: PublicKey
    created_at: datetime
    retired_at: datetime | None
    revoked_at: datetime | None

    @property
    def is_current(self) -> bool:
        """Return whether the key signs."""
        return self.retired_at is None and self.revoked_at is None


def build_keys_document(lines: Sequence[KeyLine]) -> dict[str, Any]:
    """Return the document as a JSON value."""
    return {
        "robomark_statement_keys": FORMAT,
        "keys": [
            {
                "id": line.key.id,
                "public_key": line.key.hex,
                "created_at": line.created_at.isoformat(),
                "retired_at": None if line.retired_at is None else line.retired_at.isoformat(),
                "revoked_at": None if line.revoked_at is None else line.revoked_at.isoformat(),
            }
            for line in lines
        ],
    }


def dump_keys(lines: Sequence[KeyLine]) -> bytes:
    """Return the document as JSON."""
    return (json.dumps(build_keys_document(lines), indent=1) + "\n").encode("ascii")


def parse_keys(content: bytes) -> tuple[PublicKey, ...]:
    """Return the keys of a document that are not revoked. Raises UsageError if it is no such document."""
    try:
        document = read_json(content)
        if document["robomark_statement_keys"] != FORMAT:
            raise ValueError
        return tuple(parse_public_key(each["public_key"]) for each in document["keys"] if each["revoked_at"] is None)
    except (JSONDecodeError, KeyError, TypeError, ValueError):
        raise UsageError("the file has no keys, expected the file from the page Statement keys") from None
