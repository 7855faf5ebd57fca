"""Envelopes are DSSE with Ed25519, and no change of a statement's file passes its checks or ends in a traceback."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.statements.envelopes import Envelope, parse_envelope, sign_payload
from service.statements.facts import Fact, FactKind, commit_to_facts, open_fact
from service.statements.keys import KeyLine, SigningKey, dump_keys, generate_signing_key, parse_keys, parse_public_key
from service.statements.log_head import build_filed_head, parse_filed_head
from service.statements.merkle_tree import build_inclusion_proof, compute_root, hash_leaf
from service.statements.statement import PredicateType, sign_statement
from service.statements.statement_check import check_statement
from service.statements.statement_file import LogPlace, StatementFile, parse_statement_file
from sim.errors import UsageError

pytestmark = pytest.mark.fast

MORNING = datetime(2026, 11, 2, 9, tzinfo=UTC)
KEY, OTHER_KEY = generate_signing_key(), generate_signing_key()
OPENING_KEY = bytes(range(32))
FACTS = (
    Fact(FactKind.TOTAL, 1, {"marks": "3", "max_marks": "4", "provisional": False}),
    Fact(FactKind.CRITERION, 1, {"id": "a", "title": "A", "marks": "1", "max_marks": "2"}),
    Fact(FactKind.CRITERION, 2, {"id": "b", "title": "B", "marks": "2", "max_marks": "2"}),
)


def _build_file(key: SigningKey = KEY, entry: int = 2) -> StatementFile:
    """Return the file of the third of five statements."""
    predicate = {"entry": entry, "commitments": commit_to_facts([open_fact(fact, OPENING_KEY) for fact in FACTS])}
    envelope = sign_statement(key, PredicateType.GRADE, {"submission": "ab" * 32}, predicate)
    salt = "11" * 32
    leaves = [hash_leaf(bytes([number])) for number in range(5)]
    leaves[2] = envelope.hash_as_leaf(bytes.fromhex(salt))
    head = sign_statement(key, PredicateType.LOG_HEAD, {"log": compute_root(leaves).hex()}, {"size": 5})
    proof = tuple(each.hex() for each in build_inclusion_proof(leaves, 2))
    opened_facts = tuple(open_fact(fact, OPENING_KEY) for fact in FACTS)
    return StatementFile(envelope, (key.public_key,), LogPlace(salt, proof, head), opened_facts)


OTHER_HEAD = sign_statement(OTHER_KEY, PredicateType.LOG_HEAD, {"log": "00" * 32}, {"size": 5})


def _find_failures(file: StatementFile) -> list[str]:
    try:
        checked = check_statement(parse_statement_file(file.to_bytes()), [KEY.public_key])
    except UsageError as error:
        return [str(error)]
    return [check.sentence for check in checked.checks if not check.passed]


def test_an_envelope_signs_the_encoding_of_the_specification() -> None:
    # The example of the specification: protocol.md, with the type http://example.com/HelloWorld.
    encoded = b"DSSEv1 29 http://example.com/HelloWorld 11 hello world"
    envelope = sign_payload(b"hello world", "http://example.com/HelloWorld", KEY)
    assert KEY.public_key.has_signed(envelope.signature, encoded)
    assert parse_envelope(json.loads(json.dumps(envelope.to_json()))) == envelope


def test_keys_are_those_of_rfc_8032() -> None:
    key = SigningKey("9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60")
    assert key.public_key.hex == "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"
    assert key.sign(b"").hex().startswith("e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e06522490155")
    assert key.hex not in repr(key)


def test_a_whole_file_passes() -> None:
    assert _find_failures(_build_file()) == []


@pytest.mark.parametrize(
    ("change", "failure"),
    [
        (lambda file: replace(file, envelope=replace(file.envelope, payload=b"{} ")), "contains no statement"),
        (lambda file: replace(file, envelope=replace(file.envelope, signature=bytes(64))), "is not valid"),
        (lambda file: replace(file, envelope=replace(file.envelope, key_id="0" * 16)), "not one of the given keys"),
        (lambda file: _build_file(OTHER_KEY), "not one of the given keys"),
        (lambda file: _build_file(entry=3), "not entry 3"),
        (lambda file: replace(file, place=replace(file.place, salt="12" * 32)), "not entry 2"),
        (lambda file: replace(file, place=replace(file.place, proof=file.place.proof[1:])), "not entry 2"),
        (lambda file: replace(file, place=None), "where in the log"),
        (lambda file: replace(file, place=replace(file.place, head=OTHER_HEAD)), "head of the log"),
        (lambda file: replace(file, place=replace(file.place, head=file.envelope)), "head of the log"),
        (lambda file: replace(file, facts=(_raise_marks(file.facts[0]), *file.facts[1:])), "the total facts"),
        (lambda file: replace(file, facts=(file.facts[1], replace(file.facts[2], salt="0"))), "the criterion facts"),
        (lambda file: replace(file, facts=(_renumber(file.facts[1]),)), "the criterion facts"),
    ],
)  # fmt: skip
def test_a_changed_file_fails(change: Any, failure: str) -> None:
    assert failure in _find_failures(change(_build_file()))[0]


def _renumber(opened: Any) -> Any:
    return replace(opened, fact=replace(opened.fact, number=0))


def _raise_marks(opened: Any) -> Any:
    return replace(opened, fact=replace(opened.fact, value={**opened.fact.value, "marks": "4"}))


def test_the_number_of_facts_for_staff_is_not_told() -> None:
    trials = [open_fact(Fact(FactKind.TRIAL, number, {"seed": number}), OPENING_KEY) for number in range(1, 9)]
    few, many = (commit_to_facts(each)["trial"] for each in (trials[:2], trials))
    assert len(few) == len(many) == 64
    assert few != many


_NAMES = st.sampled_from(
    ["envelope", "payload", "payloadType", "signatures", "keyid", "sig", "public_keys", "log", "facts"]
)


def _nest(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.lists(inner, max_size=3) | st.dictionaries(_NAMES, inner, max_size=4)


@given(st.recursive(st.none() | st.booleans() | st.integers() | st.text(max_size=5), _nest, max_leaves=12))
def test_any_json_is_a_statement_or_refused_with_a_sentence(value: Any) -> None:
    document = {"robomark_statement": 1, **(value if isinstance(value, dict) else {"envelope": value})}
    with pytest.raises(UsageError):
        parse_statement_file(json.dumps(document).encode())


@given(
    name=st.sampled_from(["envelope", "public_keys", "log", "facts"]),
    value=st.none() | st.integers() | st.text(max_size=3) | st.lists(st.integers(), max_size=2) | st.just({}),
)
def test_a_statement_with_a_wrong_part_is_refused_or_fails(name: str, value: Any) -> None:
    document = json.loads(_build_file().to_bytes())
    document[name] = value
    try:
        checked = check_statement(parse_statement_file(json.dumps(document).encode()), [KEY.public_key])
    except UsageError:
        return
    # Without facts, or with other public keys than the given ones, the rest of the file still passes.
    assert name in ("public_keys", "facts") or not checked.passed


@pytest.mark.parametrize("predicate", [{"assignment": 1}, {"grader": "x"}])
def test_a_predicate_with_parts_of_other_types_is_refused(predicate: Any) -> None:
    envelope = sign_statement(OTHER_KEY, PredicateType.GRADE, {}, predicate)
    with pytest.raises(UsageError, match="no statement that Robomark knows"):
        check_statement(StatementFile(envelope, (OTHER_KEY.public_key,)), [])


@pytest.mark.parametrize("marks", ["9e999999999999999999", "NaN", "sNaN", [0, [1], 0], None])
def test_a_total_of_marks_that_cannot_be_added_fails(marks: Any) -> None:
    facts = tuple(
        open_fact(Fact(kind, number, {"marks": marks}), OPENING_KEY)
        for kind, number in [(FactKind.TOTAL, 1), (FactKind.CRITERION, 1), (FactKind.CRITERION, 2)]
    )
    envelope = sign_statement(KEY, PredicateType.GRADE, {}, {"entry": 0, "commitments": commit_to_facts(facts)})
    root = {"log": envelope.hash_as_leaf(bytes(32)).hex()}
    place = LogPlace("00" * 32, (), sign_statement(KEY, PredicateType.LOG_HEAD, root, {"size": 1}))
    file = StatementFile(envelope, (KEY.public_key,), place, facts)
    assert _find_failures(file) == ["the total is not the sum of the criteria"]


def test_facts_and_roots_of_other_types_are_refused() -> None:
    document = json.loads(_build_file().to_bytes())
    document["facts"][0]["value"] = "x"
    with pytest.raises(UsageError, match="a fact without"):
        parse_statement_file(json.dumps(document).encode())
    subjects: Any = {"log": 5}
    head = sign_statement(KEY, PredicateType.LOG_HEAD, subjects, {"size": 5, "issued_at": ""})
    with pytest.raises(UsageError, match="names no root"):
        build_filed_head(head, 5, [])
    file = _build_file()
    assert file.place is not None
    assert "not entry 2" in _find_failures(replace(file, place=replace(file.place, head=head)))[0]


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff", b"[" * 100_000, b'{"robomark_statement": 2}', b"null"])
def test_what_is_no_statement_is_refused_with_a_sentence(content: bytes) -> None:
    with pytest.raises(UsageError):
        parse_statement_file(content)
    with pytest.raises(UsageError):
        parse_filed_head(content)
    with pytest.raises(UsageError):
        parse_keys(content)


def test_a_head_is_read_back_and_refused_with_other_leaves() -> None:
    leaves = [hash_leaf(bytes([number])) for number in range(5)]
    predicate = {"size": 5, "issued_at": "2026-11-02T09:00:00.000000Z"}
    envelope = sign_statement(KEY, PredicateType.LOG_HEAD, {"log": compute_root(leaves).hex()}, predicate)
    head = build_filed_head(envelope, 0, leaves)
    assert parse_filed_head(head.to_bytes()) == head
    assert parse_filed_head(build_filed_head(envelope, 3, leaves[3:]).to_bytes()).leaves == tuple(leaves[3:])
    for start, others in ((0, leaves[::-1]), (0, leaves[:4]), (3, leaves)):
        with pytest.raises(UsageError):
            build_filed_head(envelope, start, others)


def test_revoked_keys_are_not_trusted() -> None:
    lines = [KeyLine(KEY.public_key, MORNING, None, MORNING), KeyLine(OTHER_KEY.public_key, MORNING, None, None)]
    assert parse_keys(dump_keys(lines)) == (OTHER_KEY.public_key,)


@pytest.mark.parametrize("value", [None, 5, "zz" * 32, "ab" * 31, ["ab"]])
def test_a_wrong_public_key_is_refused(value: Any) -> None:
    with pytest.raises(UsageError, match="64 hexadecimal digits"):
        parse_public_key(value)


@pytest.mark.parametrize(
    "value", [{}, {"payload": "!", "payloadType": "x", "signatures": [{"keyid": "a", "sig": ""}]}, None, [], 7,
              {"payload": base64.b64encode(b"x").decode(), "payloadType": 3, "signatures": [{"keyid": "a", "sig": ""}]},
              Envelope(b"x", "t", "a", b"").to_json() | {"signatures": []}]
)  # fmt: skip
def test_a_wrong_envelope_is_refused(value: Any) -> None:
    with pytest.raises(UsageError):
        parse_envelope(value)
