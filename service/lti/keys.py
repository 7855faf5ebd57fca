"""The key pair that signs messages to platforms, and the public key set that they read."""

from __future__ import annotations

import json
from typing import Any

from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, load_pem_private_key
from jwt.algorithms import RSAAlgorithm
from sqlalchemy.orm import Session

from service.store.locks import lock_installation
from service.store.people import lti

_BITS = 2048


def ensure_signing_key(session: Session) -> tuple[str, str]:
    """Return the id and PEM of the signing key, creating it on first use."""
    if not lti.load_private_keys(session):
        lock_installation(session)
    if not lti.load_private_keys(session):
        key = rsa.generate_private_key(public_exponent=65537, key_size=_BITS)
        lti.add_private_key(
            session, key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode("ascii")
        )
    return lti.load_private_keys(session)[0]


def build_public_key_set(session: Session) -> dict[str, Any]:
    """Return the JSON Web Key Set (RFC 7517) of all keys."""
    return {"keys": [_build_public_key(key_id, pem) for key_id, pem in lti.load_private_keys(session)]}


def _build_public_key(key_id: str, pem: str) -> dict[str, Any]:
    key = load_pem_private_key(pem.encode("ascii"), None)
    assert isinstance(key, rsa.RSAPrivateKey)
    return {**json.loads(RSAAlgorithm.to_jwk(key.public_key())), "kid": key_id, "alg": "RS256", "use": "sig"}
