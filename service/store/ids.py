"""Random ids of jobs and batches: hard to guess and easy to read aloud. Independent of the tables."""

from __future__ import annotations

import secrets

ALPHABET = "0123456789abcdefghjkmnpqrstvwxyz"
LENGTH = 12


def generate_id() -> str:
    """Return a random id of 60 bits."""
    return "".join(secrets.choice(ALPHABET) for _ in range(LENGTH))
