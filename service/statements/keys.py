"""Ed25519 keys (RFC 8032) that sign statements, receipts and heads of the log. The store keeps the private keys.

``cryptography`` is imported when a key is used: most commands load this module and sign nothing.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sim.errors import UsageError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

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
