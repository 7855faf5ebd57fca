"""Where the chance of a grading comes from: the installation's secret, and the seeds that are hashed from it.

It draws nothing and keeps nothing; streams of chance are ``sim.chance``'s, keeping the secret is the service's.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Secret:
    """What keeps the worlds of an installation from being known elsewhere. Only its hash may be shown."""

    text: str = field(repr=False)

    @property
    def sha256(self) -> str:
        """Its hash, 64 hexadecimal digits, which may be shown."""
        return hashlib.sha256(self.text.encode("utf-8", "surrogateescape")).hexdigest()

    @property
    def name(self) -> str:
        """What it is called before people: the beginning of its hash."""
        return name_of(self.sha256)


#: Of self-tests, examples and whatever else must be the same everywhere.
PUBLIC = Secret("")


def name_of(secret_sha256: str) -> str:
    """What a secret with this hash is called before people."""
    return secret_sha256[:8]


def world_seed(secret: Secret, named: str) -> int:
    """63 bits for the world of what is so named, the same for every student of an installation."""
    return _bits(f"{secret.text}{named}")


def child_seed(seed: int, submission: str) -> int:
    """63 bits for the chance that one submission's own processes see, which tells nothing of the world's ``seed``.

    ``submission`` is its SHA-256. Another submission sees other chance, so chance does not tell a trial again.
    """
    return _bits(f"{seed}\n{submission}")


def _bits(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode("utf-8", "surrogateescape")).digest()[:8], "big") >> 1
