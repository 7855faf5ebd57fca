"""Assignment versions: stored once per content, with everything that a worker on another machine needs.

``submissions.assignment.reader`` reads assignments from folders.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.store.codec import decode, encode
from service.store.conditional_insert import insert_if_new
from service.store.tables.courses import AssignmentVersion
from sim.errors import UsageError
from submissions.assignment.folder import list_catalogue_ids
from submissions.suggestions import suggest_name

if TYPE_CHECKING:
    from submissions.assignment.definition import Assignment

#: New names of keys in assignments that earlier releases stored.
_NEW_KEYS = {"picture": "image", "pictures": "images"}


@dataclass(frozen=True, slots=True)
class FrozenAssignment:
    """An assignment and its stored form. Created before a transaction, so that compressing it delays no lock."""

    assignment: Assignment
    content: bytes
    sha256: str


def freeze_assignment(assignment: Assignment) -> FrozenAssignment:
    """Return the stored form of the assignment."""
    content = assignment_to_bytes(assignment)
    return FrozenAssignment(assignment, content, hashlib.sha256(zlib.decompress(content)).hexdigest())


def store_version(session: Session, frozen_assignment: FrozenAssignment, current_time: datetime) -> int:
    """Return the id of the row with exactly this content, inserting it if necessary."""
    version_query = select(AssignmentVersion.id).where(AssignmentVersion.sha256 == frozen_assignment.sha256)
    version_id = session.scalar(version_query)
    if version_id is not None:
        return version_id
    assignment = frozen_assignment.assignment
    insert_if_new(
        session,
        AssignmentVersion,
        assignment=assignment.id,
        sha256=frozen_assignment.sha256,
        version=assignment.version,
        title=assignment.title,
        max_marks=assignment.max_marks,
        content=frozen_assignment.content,
        created_at=current_time,
    )
    return session.scalars(version_query).one()


def load_version(session: Session, version_id: int) -> Assignment | None:
    """Return the assignment in a row; None if the row was deleted."""
    content = session.scalar(select(AssignmentVersion.content).where(AssignmentVersion.id == version_id))
    return None if content is None else assignment_from_bytes(content)


def check_assignment(session: Session, name: str) -> None:
    """Raise UsageError, with a similar name, if an assignment is neither in the catalogue nor stored.

    An empty name means all assignments and is accepted.
    """
    known_ids = {"", *list_catalogue_ids(), *session.scalars(select(AssignmentVersion.assignment).distinct())}
    if name not in known_ids:
        hint = suggest_name(name, known_ids) or "; robomark assignments list shows the catalogue"
        raise UsageError(f"there is no assignment {name!r}{hint}")


def assignment_to_bytes(assignment: Assignment) -> bytes:
    """Encode an assignment, including images, given files and its secret."""
    text = json.dumps(encode(assignment), sort_keys=True, separators=(",", ":"))
    return zlib.compress(text.encode("ascii"), 6)


def assignment_from_bytes(content: bytes) -> Assignment:
    """Decode an assignment. Raises ValueError or TypeError if the bytes are not one."""
    # Imports all criteria, which callers that only store or name an assignment do not need.
    from submissions.assignment.definition import Assignment

    try:
        return decode(Assignment, _rename_old_keys(json.loads(zlib.decompress(content))))
    except zlib.error as error:
        raise ValueError(f"not an assignment: {error}") from error


def _rename_old_keys(content: dict[str, Any]) -> dict[str, Any]:
    """Return the stored tables of an assignment with keys renamed to their current names."""
    renamed_tables = {
        name: _rename_keys(content[name]) for name in ("world", "training") if content.get(name) is not None
    }
    return content | renamed_tables | {"criteria": [_rename_keys(table) for table in content["criteria"]]}


def _rename_keys(table: dict[str, Any]) -> dict[str, Any]:
    return {_NEW_KEYS.get(key, key): value for key, value in table.items()}
