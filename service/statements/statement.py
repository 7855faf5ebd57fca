"""Statements on grades: in-toto statements whose predicate names submission, assignment and grading.

Format: https://github.com/in-toto/attestation, statement version 1. ``facts.py`` has what they commit to.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

from service.statements.envelopes import Envelope, sign_payload
from service.statements.keys import SigningKey
from sim.errors import UsageError
from sim.readers.json_text import JSONDecodeError, read_json
from sim.readers.reader_errors import UnreadableDataError

#: Media type of the payload of an envelope.
PAYLOAD_TYPE = "application/vnd.in-toto+json"
_STATEMENT_TYPE = "https://in-toto.io/Statement/v1"


class PredicateType(StrEnum):
    """Types of predicates."""

    GRADE = "urn:robomark:grade:1"
    RECEIPT = "urn:robomark:receipt:1"
    LOG_HEAD = "urn:robomark:log-head:1"


class Change(StrEnum):
    """Changes that an entry of the log records."""

    PUBLISHED = "published"
    CHANGED = "changed"
    WITHDRAWN = "withdrawn"
    ERASED = "erased"


@dataclass(frozen=True, slots=True)
class Statement:
    """A parsed statement: its type, the SHA-256 of each subject by name, and its predicate."""

    predicate_type: PredicateType
    subjects: Mapping[str, str]
    predicate: Mapping[str, Any]


def build_payload(predicate_type: PredicateType, subjects: Mapping[str, str], predicate: Mapping[str, Any]) -> bytes:
    """Return the payload of a statement; ``subjects`` are SHA-256 in hexadecimal by name."""
    statement = {
        "_type": _STATEMENT_TYPE,
        "subject": [{"name": name, "digest": {"sha256": digest}} for name, digest in subjects.items()],
        "predicateType": predicate_type.value,
        "predicate": dict(predicate),
    }
    return json.dumps(statement, ensure_ascii=True, separators=(",", ":")).encode("ascii")


def sign_statement(
    key: SigningKey, predicate_type: PredicateType, subjects: Mapping[str, str], predicate: Mapping[str, Any]
) -> Envelope:
    """Return a statement in an envelope, signed with the key."""
    return sign_payload(build_payload(predicate_type, subjects, predicate), PAYLOAD_TYPE, key)


def parse_statement(envelope: Envelope) -> Statement:
    """Return the statement in an envelope. Raises UsageError if it contains none."""
    if envelope.payload_type != PAYLOAD_TYPE:
        raise UsageError(
            "the envelope contains %(type)s, expected %(expected)s",
            type=repr(envelope.payload_type)[:80],
            expected=PAYLOAD_TYPE,
        )
    try:
        value = read_json(envelope.payload)
        if value["_type"] != _STATEMENT_TYPE or not isinstance(value["predicate"], dict):
            raise ValueError
        # Anybody can sign a file with a key of their own, so its parts may have any type.
        if not all(isinstance(value["predicate"].get(name, {}), dict) for name in ("assignment", "grader")):
            raise ValueError
        subjects = {each["name"]: each["digest"]["sha256"] for each in value["subject"]}
        return Statement(PredicateType(value["predicateType"]), subjects, value["predicate"])
    except (JSONDecodeError, UnreadableDataError, KeyError, TypeError, ValueError):
        raise UsageError("the envelope contains no statement that Robomark knows") from None


def format_moment(moment: datetime) -> str:
    """Return a moment as in statements: UTC with microseconds, which sort as text."""
    return moment.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def name_entries(numbers_and_leaves: Sequence[tuple[int, str]]) -> dict[str, str]:
    """Return the subjects of a statement on earlier entries, by number and hash of the leaf."""
    return {f"entry {number}": leaf for number, leaf in numbers_and_leaves}
