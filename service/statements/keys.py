"""Ed25519 keys (RFC 8032) that sign statements, receipts and heads of the log, and the document of the public keys.

``cryptography`` is imported when a key is used: most commands load this module and sign nothing.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sim.errors import UsageError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey


import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sim.readers.json_text import JSONDecodeError, read_json

#: Version of the format, and the limit of a file that is read.
FORMAT = 1
MAX_FILE_BYTES = 1_000_000
#: Bytes of a public and of a private key.
KEY_BYTES = 32
_ID_LENGTH = 16


@dataclass(frozen=True, slots=True)
class PublicKey:
    """The public half of a key: 32 bytes, as 64 hexadecimal digits."""

    hex: str

    @property
    def id(self) -> str:
        """The key's id: the first 16 hexadecimal digits of the SHA-256 of its bytes."""
        return hashlib.sha256(bytes.fromhex(self.hex)).hexdigest()[:_ID_LENGTH]

    def has_signed(self, signature: bytes, content: bytes) -> bool:
        """Return whether this key made the signature of ``content``."""
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        try:
            Ed25519PublicKey.from_public_bytes(bytes.fromhex(self.hex)).verify(signature, content)
        except InvalidSignature:
            return False
        return True


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A private key, as 64 hexadecimal digits."""

    hex: str = field(repr=False)

    @property
    def public_key(self) -> PublicKey:
        """The public half."""
        return PublicKey(self._load().public_key().public_bytes_raw().hex())

    def sign(self, content: bytes) -> bytes:
        """Return the signature of ``content``: the same bytes each time."""
        return self._load().sign(content)

    def _load(self) -> Ed25519PrivateKey:
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

        return Ed25519PrivateKey.from_private_bytes(bytes.fromhex(self.hex))


def generate_signing_key() -> SigningKey:
    """Return a new random key."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    return SigningKey(Ed25519PrivateKey.generate().private_bytes_raw().hex())


def parse_public_key(value: object) -> PublicKey:
    """Return the public key with these hexadecimal digits. Raises UsageError if they are none."""
    try:
        if isinstance(value, str) and len(bytes.fromhex(value)) == KEY_BYTES:
            return PublicKey(value.lower())
    except ValueError:
        pass
    raise UsageError("the public key is %(value)s, expected 64 hexadecimal digits", value=repr(value)[:80])


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
