"""Launches of learning platforms that were begun and not completed yet. Only hashes of their states are stored."""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass
from datetime import timedelta

from sqlalchemy import delete, or_, select
from sqlalchemy.orm import Session

from service.store.engine import now
from service.store.people.lti import Platform, build_platform, lock_platform
from service.store.tables.people import LtiLaunch, LtiPlatform

_LAUNCH_LIFETIME = timedelta(minutes=10)
#: Maximum number of pending launches of a platform. Anybody can start one, so the oldest are dropped.
MAX_PENDING = 10_000


@dataclass(frozen=True, slots=True)
class PendingLaunch:
    """A launch that was answered, with the values it started with."""

    platform: Platform
    nonce: str
    target: str


def begin_launch(session: Session, platform: Platform, target: str) -> tuple[str, str]:
    """Return a new state and nonce, each valid once and for a few minutes.

    At most ``MAX_PENDING`` launches of a platform are kept.
    """
    lock_platform(session, platform)
    current_time, is_same_platform = now(session), LtiLaunch.platform_id == platform.id
    newest_first = select(LtiLaunch.state_sha256).where(is_same_platform).order_by(LtiLaunch.expires_at.desc())
    is_expired = or_(
        LtiLaunch.expires_at < current_time, LtiLaunch.state_sha256.in_(newest_first.offset(MAX_PENDING - 1))
    )
    session.execute(delete(LtiLaunch).where(is_same_platform, is_expired).execution_options(synchronize_session=False))
    state, nonce = secrets.token_urlsafe(32), secrets.token_urlsafe(32)
    session.add(
        LtiLaunch(
            state_sha256=_hash_text(state),
            platform_id=platform.id,
            nonce=nonce,
            target=target,
            expires_at=current_time + _LAUNCH_LIFETIME,
        )
    )
    return state, nonce


def has_launch(session: Session, state: str) -> bool:
    """Whether a launch with this state was started and not completed yet; it may have expired."""
    return session.get(LtiLaunch, _hash_text(state)) is not None


def take_launch(session: Session, state: str) -> PendingLaunch | None:
    """Return and delete the launch with this state; None if it does not exist or has expired."""
    row = session.get(LtiLaunch, _hash_text(state), with_for_update={"key_share": True})
    if row is None:
        return None
    session.delete(row)
    if row.expires_at <= now(session):
        return None
    return PendingLaunch(build_platform(session.get_one(LtiPlatform, row.platform_id)), row.nonce, row.target)


def _hash_text(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
