"""Files of a job, kept in the database so that they commit with its marks and reach every machine.

Small ones only: what is over the cap is refused. What is in them is their makers' business.
"""

from __future__ import annotations

import hashlib
import zlib
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from service.store.models import Artifact
from sim.errors import HostError

CAP_BYTES = 64_000_000


@dataclass(frozen=True, slots=True)
class File:
    """A file to keep, or one that was kept."""

    name: str
    media_type: str
    data: bytes


def put(session: Session, job_id: str, files: list[File], at: datetime) -> None:
    """Keep the files; one of the same name is replaced. Raises HostError for one over the cap."""
    for file in files:
        compressed = zlib.compress(file.data, 6)
        if len(compressed) > CAP_BYTES:
            raise HostError(f"{file.name} is too large to be kept: {len(compressed)} bytes of {CAP_BYTES}")
        session.execute(delete(Artifact).where(Artifact.job_id == job_id, Artifact.name == file.name))
        session.add(
            Artifact(
                job_id=job_id,
                name=file.name,
                media_type=file.media_type,
                sha256=hashlib.sha256(file.data).hexdigest(),
                size=len(file.data),
                compressed=compressed,
                created_at=at,
            )
        )


def get(session: Session, job_id: str, *, prefix: str = "") -> dict[str, File]:
    """The files of a job whose names begin with ``prefix``, by name.

    Raises HostError where the bytes are not those that were kept.
    """
    query = select(Artifact.name, Artifact.media_type, Artifact.sha256, Artifact.compressed).where(
        Artifact.job_id == job_id, Artifact.name.startswith(prefix, autoescape=True)
    )
    files = {}
    for name, media_type, sha256, compressed in session.execute(query.order_by(Artifact.name)):
        try:
            data = zlib.decompress(compressed)
        except zlib.error as error:
            raise HostError(f"The database is damaged: {name} of {job_id}: {error}") from None
        if hashlib.sha256(data).hexdigest() != sha256:
            raise HostError(f"The database is damaged: {name} of {job_id} has another hash than when it was kept")
        files[name] = File(name, media_type, data)
    return files
