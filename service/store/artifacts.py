"""Files of a job, stored in the database so that they commit with its marks and are available on every machine.

Only small files: files over ``CAP_BYTES`` are rejected. The content is not interpreted here.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby

from sqlalchemy import and_, delete, or_, select
from sqlalchemy.orm import Session

from service.store.tables.grades import Artifact
from service.store.tables.submissions import Job
from sim.errors import HostError

CAP_BYTES = 64_000_000
#: Number of files fetched at once.
_CHUNK_SIZE = 20


@dataclass(frozen=True, slots=True)
class File:
    """A file to store, or a stored file."""

    name: str
    media_type: str
    data: bytes


def store_files(session: Session, job_id: str, files: list[File], current_time: datetime) -> None:
    """Store the files of a job, replacing files with the same name. Raises HostError for a file over the cap."""
    for file in files:
        compressed_data = zlib.compress(file.data, 6)
        if len(compressed_data) > CAP_BYTES:
            raise HostError(f"{file.name} is too large to be kept: {len(compressed_data)} bytes of {CAP_BYTES}")
        session.execute(delete(Artifact).where(Artifact.job_id == job_id, Artifact.name == file.name))
        session.add(
            Artifact(
                job_id=job_id,
                name=file.name,
                media_type=file.media_type,
                sha256=hashlib.sha256(file.data).hexdigest(),
                size=len(file.data),
                compressed=compressed_data,
                created_at=current_time,
            )
        )


def load_files(session: Session, job_id: str, *, prefix: str = "") -> dict[str, File]:
    """Return the files of a job whose names begin with ``prefix``, by name. Raises like ``load_each_files``."""
    return dict(load_each_files(session, [job_id], prefix=prefix)).get(job_id, {})


def load_each_files(
    session: Session, job_ids: Collection[str], *, prefix: str | tuple[str, ...] = ""
) -> Iterator[tuple[str, dict[str, File]]]:
    """Yield each job id with its files, read in one statement and ordered by id. ``prefix`` as for ``str.startswith``.

    Only the files of one job are in memory at a time. Raises HostError if a file does not match its hash.
    """
    prefixes = (prefix,) if isinstance(prefix, str) else prefix
    is_named = or_(*(Artifact.name.startswith(each, autoescape=True) for each in prefixes))
    has_prefix = and_(Artifact.job_id == Job.id, is_named)
    query = (
        select(Job.id, Artifact.name, Artifact.media_type, Artifact.sha256, Artifact.compressed)
        .outerjoin(Artifact, has_prefix)
        .where(Job.id.in_(job_ids))
        .order_by(Job.id, Artifact.name)
    )
    rows = session.execute(query, execution_options={"yield_per": _CHUNK_SIZE})
    for job_id, job_rows in groupby(rows, key=lambda row: row[0]):
        # A job without such files yields one row without a file.
        files = [(name, media_type, sha256, data) for _, name, media_type, sha256, data in job_rows if name is not None]
        yield job_id, {each[0]: _unpack_file(job_id, *each) for each in files}


def _unpack_file(job_id: str, name: str, media_type: str, sha256: str, compressed_data: bytes) -> File:
    try:
        data = zlib.decompress(compressed_data)
    except zlib.error as error:
        raise HostError(f"The database is damaged: {name} of {job_id}: {error}") from None
    if hashlib.sha256(data).hexdigest() != sha256:
        raise HostError(f"The database is damaged: {name} of {job_id} has another hash than when it was kept")
    return File(name, media_type, data)
