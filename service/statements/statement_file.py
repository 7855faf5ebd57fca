"""The file of a statement: the signed envelope, its place in the log, and the facts that its reader may see.

A file for students has no seeds. One for staff has all facts, all seeds, and the ticks of the recordings.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from service.statements.envelopes import Envelope, parse_envelope
from service.statements.facts import OpenFact, parse_open_fact
from service.statements.keys import PublicKey, parse_public_key
from sim.errors import UsageError
from sim.readers.json_text import JSONDecodeError, read_json
from submissions.seeds import SeedTable

#: Version of the format, and the limits of a file that is read.
FORMAT = 1
MAX_FILE_BYTES = 64_000_000
_MAX_PROOF_LENGTH = 64


@dataclass(frozen=True, slots=True)
class LogPlace:
    """The place of a statement in the log: proof of inclusion in the tree of the signed head.

    ``salt`` and the hashes of the ``proof`` are hexadecimal.
    """

    salt: str
    proof: tuple[str, ...]
    head: Envelope


@dataclass(frozen=True, slots=True)
class StatementFile:
    """A statement or receipt with what its reader needs to check it. A receipt has no place in the log.

    ``columns`` are the encoded ticks of trials, by their number in the statement.
    """

    envelope: Envelope
    public_keys: tuple[PublicKey, ...]
    place: LogPlace | None = None
    facts: tuple[OpenFact, ...] = ()
    seeds: SeedTable | None = field(default=None, repr=False)
    columns: Mapping[int, Mapping[str, str]] = field(default_factory=dict, repr=False)

    def to_bytes(self) -> bytes:
        """Return the file as JSON."""
        document: dict[str, Any] = {
            "robomark_statement": FORMAT,
            "envelope": self.envelope.to_json(),
            "public_keys": [key.hex for key in self.public_keys],
        }
        if self.place is not None:
            document["log"] = {
                "salt": self.place.salt,
                "proof": list(self.place.proof),
                "head": self.place.head.to_json(),
            }
            document["facts"] = [each.to_json() for each in self.facts]
        if self.seeds is not None:
            document["seeds"] = {"secret_sha256": self.seeds.sha256, "by_world": dict(self.seeds.seeds)}
            document["columns"] = {str(number): dict(columns) for number, columns in self.columns.items()}
        return (json.dumps(document, indent=1, ensure_ascii=True) + "\n").encode("ascii")


def parse_statement_file(content: bytes) -> StatementFile:
    """Return the statement in a file. Raises UsageError if it is no such file, or larger than 64 MB."""
    if len(content) > MAX_FILE_BYTES:
        raise UsageError("the file has more than %(most)s MB", most=MAX_FILE_BYTES // 1_000_000)
    try:
        document = read_json(content)
    except JSONDecodeError:
        raise UsageError("the file is not JSON, expected a statement or a receipt") from None
    version = document.get("robomark_statement") if isinstance(document, dict) else None
    if version != FORMAT:
        raise UsageError("the file is no statement, expected robomark_statement: %(format)s", format=FORMAT)
    try:
        return StatementFile(
            parse_envelope(document["envelope"]),
            tuple(parse_public_key(each) for each in document["public_keys"]),
            _parse_place(document["log"]) if "log" in document else None,
            tuple(parse_open_fact(each) for each in document.get("facts", ())),
            _parse_seeds(document["seeds"]) if "seeds" in document else None,
            {int(number): _parse_texts(columns) for number, columns in document.get("columns", {}).items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError):
        raise UsageError("the file is incomplete; download the statement again") from None


def _parse_place(value: Any) -> LogPlace:
    proof = tuple(bytes.fromhex(each).hex() for each in value["proof"])
    if len(proof) > _MAX_PROOF_LENGTH:
        raise ValueError
    return LogPlace(bytes.fromhex(value["salt"]).hex(), proof, parse_envelope(value["head"]))


def _parse_seeds(value: Any) -> SeedTable:
    seeds = value["by_world"]
    if not all(type(seed) is int and 0 <= seed < 1 << 63 for seed in seeds.values()):
        raise ValueError
    if not isinstance(value["secret_sha256"], str):
        raise TypeError
    return SeedTable(value["secret_sha256"], dict(seeds))


def _parse_texts(value: Any) -> dict[str, str]:
    if not all(isinstance(text, str) for text in value.values()):
        raise TypeError
    return dict(value)
