"""Facts of a grade, to which its statement commits without saying them: total, criteria, trials.

A reader gets the facts that this reader may see, each with its salt, and can check them against the commitments. Those
that only staff see have one commitment together, which does not tell how many they are.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sim.errors import UsageError

#: Bytes of the key from which the salts of a statement's facts are computed.
OPENING_KEY_BYTES = 32
_SALT_DIGITS = 32
_encode = json.JSONEncoder(ensure_ascii=True, separators=(",", ":"), sort_keys=True).encode


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
        content = [self.salt, self.fact.kind.value, self.fact.number, self.fact.value]
        return hashlib.sha256(_encode(content).encode("ascii")).hexdigest()

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
    salt = hmac.digest(opening_key, f"{fact.kind.value} {fact.number}".encode("ascii"), "sha256")
    return OpenFact(fact, salt.hex()[:_SALT_DIGITS])


def commit_to_facts(facts: Sequence[OpenFact]) -> dict[str, Any]:
    """Return the commitments of a statement by kind: a list, or for kinds that only staff see one hash of it."""
    commitments: dict[str, list[str]] = {kind.value: [] for kind in FactKind}
    for each in sorted(facts, key=lambda each: each.fact.number):
        commitments[each.fact.kind.value].append(each.commitment)
    return {
        kind: hashlib.sha256(_encode(listed).encode("ascii")).hexdigest() if kind in SEALED_KINDS else listed
        for kind, listed in commitments.items()
    }


def parse_open_fact(value: Any) -> OpenFact:
    """Return the fact of a JSON value. Raises UsageError if it is none."""
    try:
        kind, number, salt = FactKind(value["kind"]), value["number"], value["salt"]
        if type(number) is int and isinstance(salt, str) and isinstance(value["value"], dict):
            return OpenFact(Fact(kind, number, value["value"]), salt)
    except (KeyError, TypeError, ValueError):
        pass
    raise UsageError("the file has a fact without kind, number, value and salt")
