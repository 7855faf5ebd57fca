"""Seeds of a grading, computed as hashes of the installation's secret, or from a table of such seeds.

``sim.random_streams`` draws random numbers, and ``service`` stores the secret.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from sim.errors import UsageError

_NAME_DIGITS = 32


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

    def compute_seed(self, world_name: str) -> int:
        """Return 63 bits as the seed of the named world, the same for every student of an installation."""
        return _hash_to_bits(f"{self.text}{world_name}")


@dataclass(frozen=True, slots=True)
class SeedTable:
    """Seeds of some worlds, for a grading on another installation, which does not know the secret.

    ``seeds`` are by the hash of the world's name. ``sha256`` is that of the secret that they were computed from.
    """

    sha256: str
    seeds: Mapping[str, int] = field(repr=False)

    def compute_seed(self, world_name: str) -> int:
        """Return the seed of the named world. Raises UsageError if the table does not have it."""
        try:
            return self.seeds[_hash_name(world_name)]
        except KeyError:
            raise UsageError("the table of seeds is for another assignment, or another version of it") from None


#: Where the seeds of a grading come from.
SeedSource = Secret | SeedTable

#: For self-tests, examples and other results that must be the same on every installation.
PUBLIC_SECRET = Secret("")


def format_secret_name(secret_sha256: str) -> str:
    """Return the displayed name of a secret with this hash."""
    return secret_sha256[:8]


def choose_secret(needed_sha256: str, own_secret: Secret) -> Secret | None:
    """Return the secret with this hash, which a stored grade needs; None if it is another installation's.

    Grades from before an installation had a secret need ``PUBLIC_SECRET``.
    """
    return next((each for each in (own_secret, PUBLIC_SECRET) if each.sha256 == needed_sha256), None)


def build_seed_table(secret: SeedSource, world_names: Iterable[str]) -> SeedTable:
    """Return the seeds of the named worlds."""
    return SeedTable(secret.sha256, {_hash_name(name): secret.compute_seed(name) for name in world_names})


def compute_child_seed(seed: int, submission: str) -> int:
    """Return 63 bits as the seed for a submission's own processes, from which ``seed`` cannot be inferred.

    ``submission`` is its SHA-256. Another submission gets another seed, so that random numbers do not identify a trial.
    """
    return _hash_to_bits(f"{seed}\n{submission}")


def _hash_name(world_name: str) -> str:
    return hashlib.sha256(world_name.encode("utf-8", "surrogateescape")).hexdigest()[:_NAME_DIGITS]


def _hash_to_bits(text: str) -> int:
    return int.from_bytes(hashlib.sha256(text.encode("utf-8", "surrogateescape")).digest()[:8], "big") >> 1
