"""DSSE envelopes: a payload with its signatures, whose bytes are kept as they were signed.

Format: https://github.com/secure-systems-lab/dsse, version 1.0.2, with Ed25519 (RFC 8032). An envelope is JSON.
"""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from typing import Any

from service.statements.keys import PublicKey, SigningKey
from service.statements.merkle_tree import hash_leaf
from sim.errors import UsageError


@dataclass(frozen=True, slots=True)
class Envelope:
    """A payload, its media type, and one signature with the id of its key."""

    payload: bytes
    payload_type: str
    key_id: str
    signature: bytes

    def to_json(self) -> dict[str, Any]:
        """Return the envelope as a JSON value."""
        return {
            "payload": _encode(self.payload),
            "payloadType": self.payload_type,
            "signatures": [{"keyid": self.key_id, "sig": _encode(self.signature)}],
        }

    def hash_as_leaf(self, salt: bytes) -> bytes:
        """Return the leaf of the log: the hash of salt (32 bytes), signature (64 bytes) and payload."""
        return hash_leaf(salt + self.signature + self.payload)

    def is_signed_by(self, key: PublicKey) -> bool:
        """Return whether the signature is that of this key."""
        return key.id == self.key_id and key.has_signed(self.signature, _build_signed_bytes(self))


def sign_payload(payload: bytes, payload_type: str, key: SigningKey) -> Envelope:
    """Return the payload in an envelope, signed with the key."""
    envelope = Envelope(payload, payload_type, key.public_key.id, b"")
    return Envelope(payload, payload_type, envelope.key_id, key.sign(_build_signed_bytes(envelope)))


def parse_envelope(value: Any) -> Envelope:
    """Return the envelope of a JSON value. Raises UsageError if it is none, or has not exactly one signature."""
    try:
        signatures = value["signatures"]
        if len(signatures) != 1:
            raise UsageError("the envelope has %(count)s signatures, expected one", count=len(signatures))
        texts = (value["payload"], signatures[0]["sig"])
        payload, signature = (base64.b64decode(each, validate=True) for each in texts)
        payload_type, key_id = value["payloadType"], signatures[0]["keyid"]
        if not isinstance(payload_type, str) or not isinstance(key_id, str):
            raise TypeError
        return Envelope(payload, payload_type, key_id, signature)
    except (KeyError, IndexError, TypeError, ValueError, binascii.Error):
        raise UsageError("the file has no signed envelope, expected DSSE with payload and one signature") from None


def _build_signed_bytes(envelope: Envelope) -> bytes:
    """Return the pre-authentication encoding of an envelope, which is what a signature covers."""
    payload_type = envelope.payload_type.encode("utf-8", "surrogateescape")
    return b"DSSEv1 %d %b %d %b" % (len(payload_type), payload_type, len(envelope.payload), envelope.payload)


def _encode(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
