"""Checks of a statement or receipt without a database: signature, log, facts, and the submission that it names."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

from service.statements.envelopes import Envelope
from service.statements.facts import SEALED_KINDS, FactKind, OpenFact, commit_to_facts
from service.statements.keys import PublicKey
from service.statements.merkle_tree import is_included
from service.statements.statement import PredicateType, Statement, parse_statement
from service.statements.statement_file import LogPlace, StatementFile
from sim.errors import UsageError
from submissions.submission import Submission

_MAX_VALUE_LENGTH = 121


@dataclass(frozen=True, slots=True)
class Check:
    """One check and its result, as a sentence."""

    passed: bool
    sentence: str


@dataclass(frozen=True, slots=True)
class CheckedStatement:
    """A parsed statement with its checks."""

    statement: Statement
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Return whether all checks passed."""
        return all(check.passed for check in self.checks)


def check_statement(file: StatementFile, trusted_keys: Collection[PublicKey]) -> CheckedStatement:
    """Check a file without any other data. Without ``trusted_keys``, the keys in the file are used.

    Raises UsageError if its envelope contains no statement on a grade and no receipt.
    """
    statement = parse_statement(file.envelope)
    if statement.predicate_type not in (PredicateType.GRADE, PredicateType.RECEIPT):
        raise UsageError("the file contains a head of the log; check it with robomark log check")
    keys = tuple(trusted_keys) or file.public_keys
    checks = [_check_signature(file.envelope, keys, is_trusted=bool(trusted_keys))]
    if statement.predicate_type is PredicateType.GRADE:
        checks.extend(_check_place(file, statement, keys))
        checks.extend(_check_facts(file, statement))
    return CheckedStatement(statement, tuple(checks))


def check_submission(statement: Statement, submission: Submission) -> Check:
    """Check that the statement is on this submission."""
    if statement.subjects.get("submission") == submission.sha256:
        return Check(True, "the submission is the one that the statement names")
    return Check(False, f"the submission is another one: its SHA-256 is {submission.sha256}")


def collect_values(file: StatementFile, kind: FactKind) -> dict[int, Any]:
    """Return the values of the file's facts of one kind, by number."""
    return {each.fact.number: each.fact.value for each in file.facts if each.fact.kind is kind}


def format_value(value: Any) -> str:
    """Return a value of a file in one printable line of at most 120 characters."""
    text = "".join(character if character.isprintable() else "?" for character in str(value)[:_MAX_VALUE_LENGTH])
    return text if len(text) < _MAX_VALUE_LENGTH else f"{text[: _MAX_VALUE_LENGTH - 4]}..."


def _check_signature(envelope: Envelope, keys: Collection[PublicKey], *, is_trusted: bool) -> Check:
    key = next((key for key in keys if key.id == envelope.key_id), None)
    if key is None:
        return Check(False, f"it is signed with the key {envelope.key_id!r:.40}, which is not one of the given keys")
    if not envelope.is_signed_by(key):
        return Check(False, f"the signature of the key {key.id} is not valid: the statement was changed")
    origin = "" if is_trusted else "; the key is from the file, so compare it with the page Statement keys"
    return Check(True, f"the signature of the key {key.id} is valid{origin}")


def _check_place(file: StatementFile, statement: Statement, keys: Collection[PublicKey]) -> Iterator[Check]:
    place = file.place
    if place is None:
        yield Check(False, "the file does not say where in the log the statement is")
        return
    head = parse_statement(place.head)
    if head.predicate_type is not PredicateType.LOG_HEAD or not any(place.head.is_signed_by(key) for key in keys):
        yield Check(False, "the head of the log is not signed with a given key")
        return
    number, size = statement.predicate.get("entry"), head.predicate.get("size")
    if _is_in_log(file.envelope, place, number, size, head.subjects.get("log", "")):
        yield Check(True, f"it is entry {number} of the log of {size} entries")
    else:
        yield Check(False, f"it is not entry {number!r:.20} of the log of {size!r:.20} entries")


def _is_in_log(envelope: Envelope, place: LogPlace, number: Any, size: Any, root: str) -> bool:
    if type(number) is not int or type(size) is not int:
        return False
    proof = [bytes.fromhex(each) for each in place.proof]
    try:
        return is_included(envelope.hash_as_leaf(bytes.fromhex(place.salt)), number, size, proof, bytes.fromhex(root))
    except (TypeError, ValueError):
        return False


def _check_facts(file: StatementFile, statement: Statement) -> Iterator[Check]:
    stated = statement.predicate.get("commitments")
    commitments = stated if isinstance(stated, dict) else {}
    own_commitments = commit_to_facts(file.facts)
    for kind in FactKind:
        facts = [each for each in file.facts if each.fact.kind is kind]
        listed = commitments.get(kind.value)
        is_stated = own_commitments[kind.value] == listed if kind in SEALED_KINDS else _are_listed(facts, listed)
        if facts and not is_stated:
            yield Check(False, f"the {kind.value} facts are not what was signed")
            return
    yield Check(True, f"{len(file.facts)} facts are those that were signed")
    yield from _check_total(file, commitments)


def _are_listed(facts: Sequence[OpenFact], listed: Any) -> bool:
    """Return whether the commitment to each fact is at its place in the list."""
    return isinstance(listed, list) and all(
        each.fact.number > 0 and listed[each.fact.number - 1 :][:1] == [each.commitment] for each in facts
    )


def _check_total(file: StatementFile, commitments: Any) -> Iterator[Check]:
    """Compare the total with the sum of the criteria, if the reader has all of them."""
    total, criteria = collect_values(file, FactKind.TOTAL).get(1), collect_values(file, FactKind.CRITERION)
    hidden = collect_values(file, FactKind.HIDDEN_CRITERION)
    listed = commitments.get(FactKind.CRITERION.value)
    if total is None or not isinstance(listed, list) or len(criteria) != len(listed):
        return
    try:
        marks = sum((Decimal(each["marks"]) for each in (*criteria.values(), *hidden.values())), Decimal(0))
        is_sum = marks == Decimal(total["marks"])
    except (KeyError, TypeError, ValueError, ArithmeticError):
        is_sum = False
    yield Check(
        is_sum, "the total is the sum of the criteria" if is_sum else "the total is not the sum of the criteria"
    )
