"""Seeds of a grading, computed as hashes of the installation's secret.

``sim.random_streams`` draws random numbers, and ``service`` stores the secret.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Secret:
    """Secret that makes the worlds of an installation unpredictable. Only its hash may be shown."""

    text: str = field(repr=False)

    @property
    def sha256(self) -> str:
        """The hash as 64 hexadecimal digits, which may be shown."""
        return hashlib.sha256(self.text.encode("utf-8", "surrogateescape")).hexdigest()

    @property
    def name(self) -> str:
        """The displayed name: the first digits of the hash."""
        return format_secret_name(self.sha256)


#: For self-tests, examples and other results that must be the same on every installation.
PUBLIC_SECRET = Secret("")


def format_secret_name(secret_sha256: str) -> str:
    """Return the displayed name of a secret with this hash."""
    return secret_sha256[:8]


def compute_world_seed(secret: Secret, world_name: str) -> int:
    """Return 63 bits as the seed of the named world, the same for every student of an installation."""
    return _hash_to_bits(f"{secret.text}{world_name}")


def compute_child_seed(seed: int, submission: str) -> int:
    """Return 63 bits as the seed for a submission's own processes, from which ``seed`` cannot be inferred.

    ``submission`` is its SHA-256. Another submission gets another seed, so that random numbers do not identify a trial.
    """
    return _hash_to_bits(f"{seed}\n{submission}")


def _hash_to_bits(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode("utf-8", "surrogateescape")).digest()[:8], "big") >> 1
