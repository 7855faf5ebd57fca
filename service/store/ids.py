"""Names of jobs and batches: hard to guess, easy to read out. Knows no table."""

from __future__ import annotations

import secrets

ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"
LENGTH = 12


def new_id() -> str:
    """A name of 60 bits of chance."""
    return "".join(secrets.choice(ALPHABET) for _ in range(LENGTH))
