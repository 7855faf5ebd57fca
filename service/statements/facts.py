"""Facts of a grade, to which its statement commits without saying them: total, criteria, trials.

A reader gets the facts that this reader may see, each with its salt, and can check them against the commitments. Those
that only staff see have one commitment together, which does not tell how many they are.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sim.errors import UsageError

#: Bytes of the key from which the salts of a statement's facts are computed.
OPENING_KEY_BYTES = 32
_SALT_DIGITS = 32
#: Digits of a salt. Other characters would need escapes in the JSON of a commitment.
_HEXADECIMAL = frozenset("0123456789abcdef")
#: Return the JSON of a value as commitments contain it.
encode_value = json.JSONEncoder(ensure_ascii=True, separators=(",", ":"), sort_keys=True).encode


class FactKind(StrEnum):
    """Kinds of facts. Facts of each kind are numbered from 1."""

    TOTAL = "total"
    CRITERION = "criterion"
    HIDDEN_CRITERION = "hidden criterion"
    TRIAL = "trial"


#: Kinds whose facts only staff see.
SEALED_KINDS = frozenset({FactKind.HIDDEN_CRITERION, FactKind.TRIAL})


@dataclass(frozen=True, slots=True)
class Fact:
    """A fact as a JSON value."""

    kind: FactKind
    number: int
    value: Any


@dataclass(frozen=True, slots=True)
class OpenFact:
    """A fact with the salt (hexadecimal) of its commitment."""

    fact: Fact
    salt: str

    @property
    def commitment(self) -> str:
        """The commitment: the SHA-256 of the JSON array of salt, kind, number and value, without spaces."""
        return _commit(self.salt, self.fact.kind.value, self.fact.number, encode_value(self.fact.value))

    def to_json(self) -> dict[str, Any]:
        """Return the fact as in the file of a statement."""
        return {
            "kind": self.fact.kind.value,
            "number": self.fact.number,
            "value": self.fact.value,
            "salt": self.salt,
        }


def open_fact(fact: Fact, opening_key: bytes) -> OpenFact:
    """Return the fact with its salt, from which neither the key nor another salt can be computed."""
    return OpenFact(fact, _compute_salt(opening_key, fact.kind.value, fact.number))


def commit_to_facts(facts: Sequence[OpenFact]) -> dict[str, Any]:
    """Return the commitments of a statement by kind: a list, or for kinds that only staff see one hash of it."""
    commitments: dict[FactKind, list[str]] = {kind: [] for kind in FactKind}
    for each in sorted(facts, key=lambda each: each.fact.number):
        commitments[each.fact.kind].append(each.commitment)
    return {kind.value: _seal(kind, listed) for kind, listed in commitments.items()}


def commit_to_values(kind: FactKind, values: Iterable[str], opening_key: bytes) -> Any:
    """Return the commitments to all values of a kind, as ``commit_to_facts`` does; ``values`` are their JSON."""
    word = kind.value
    listed = [
        _commit(_compute_salt(opening_key, word, number), word, number, value) for number, value in enumerate(values, 1)
    ]
    return _seal(kind, listed)


def parse_open_fact(value: Any) -> OpenFact:
    """Return the fact of a JSON value. Raises UsageError if it is none."""
    try:
        kind, number, salt = FactKind(value["kind"]), value["number"], value["salt"]
        if type(number) is int and _HEXADECIMAL.issuperset(salt) and isinstance(value["value"], dict):
            return OpenFact(Fact(kind, number, value["value"]), salt)
    except (KeyError, TypeError, ValueError):
        pass
    raise UsageError("the file has a fact without kind, number, value and salt")


def _compute_salt(opening_key: bytes, kind: str, number: int) -> str:
    return hmac.digest(opening_key, f"{kind} {number}".encode("ascii"), "sha256").hex()[:_SALT_DIGITS]


def _commit(salt: str, kind: str, number: int, value: str) -> str:
    return hashlib.sha256(f'["{salt}","{kind}",{number},{value}]'.encode("ascii")).hexdigest()


def _seal(kind: FactKind, commitments: list[str]) -> Any:
    """Return the commitments, or for kinds that only staff see the hash of their list."""
    if kind not in SEALED_KINDS:
        return commitments
    return hashlib.sha256(encode_value(commitments).encode("ascii")).hexdigest()
