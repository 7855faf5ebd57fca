"""Requests of notebooks as a server stores them, and the built-in assignments to which they belong.

They are stored where a test run has its submission, which is a zip archive and begins otherwise.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from service.notebook_engine.requests import MagicRequest
from service.store.queue.test_runs import NOTEBOOK_CHECKS, NOTEBOOK_RUNS
from sim.readers.json_text import read_json
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.submission import Submission

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment

_MAGIC, _CHECK = b"robomark notebook magic\n", b"robomark notebook check\n"


@dataclass(frozen=True, slots=True)
class StoredMagic:
    """A magic, and the answers to the first questions of its run."""

    request: MagicRequest
    answers: tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class StoredCheck:
    """A check of a submission against a version of an assignment, by the id of its row."""

    version_id: int
    submission: Submission


def pack_magic(request: MagicRequest, answers: Sequence[str | None]) -> bytes:
    """Return the bytes to store for a magic."""
    fields = set(MagicRequest.model_fields)
    document = {"request": request.model_dump(mode="json", include=fields), "answers": list(answers)}
    return _MAGIC + json.dumps(document, separators=(",", ":"), allow_nan=False).encode("ascii")


def pack_check(version_id: int, submission: Submission) -> bytes:
    """Return the bytes to store for a check."""
    return _CHECK + b"%d\n" % version_id + pack_submission(submission)


def unpack_request(packed: bytes) -> StoredMagic | StoredCheck | None:
    """Return the stored request; None for the submission of a test run."""
    if packed.startswith(_MAGIC):
        document: dict[str, Any] = read_json(packed.removeprefix(_MAGIC))
        return StoredMagic(MagicRequest.read(document["request"]), tuple(document["answers"]))
    if packed.startswith(_CHECK):
        version_id, _, archive = packed.removeprefix(_CHECK).partition(b"\n")
        return StoredCheck(int(version_id), unpack_submission(archive))
    return None


def list_stored_files(packed: bytes) -> dict[str, bytes]:
    """Return the stored request as files for people, by name; empty if it is no longer stored."""
    if packed.startswith(_MAGIC):
        return {"request.json": packed.removeprefix(_MAGIC)}
    if packed.startswith(_CHECK):
        return {"submission.zip": packed.removeprefix(_CHECK).partition(b"\n")[2]}
    return {"submission.zip": packed} if packed else {}


def build_owner(kind: str) -> Assignment:
    """Return the built-in assignment of ``NOTEBOOK_RUNS`` or ``NOTEBOOK_CHECKS``, without scenarios and criteria."""
    from submissions.assignment.definition import Assignment, Parts, WorldSpec

    return Assignment(kind, _TITLES[kind], WorldSpec(), Parts(), (), ())


_TITLES: Mapping[str, str] = MappingProxyType({NOTEBOOK_RUNS: "Notebook", NOTEBOOK_CHECKS: "Check of a notebook"})
