"""Sign-in links that a user created for another user. The creator sees a link until it is used or expires.

A link is derived from the creator's session and a word in the page's address. It is not stored, and the address alone
does not reveal it.
"""

from __future__ import annotations

import base64
import hmac
import secrets
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from fastapi import Query, Request

from service.operations import sign_in_links
from service.web.access import Reader
from service.web.context import WebContext

#: The word in the page's address; empty if no link is shown.
LinkWord = Annotated[str, Query(alias="link", max_length=64)]


@dataclass(frozen=True, slots=True)
class CreatedLink:
    """A sign-in link with its owner and its time of expiry."""

    url: str
    person_id: int
    name: str
    expires_at: datetime


def generate_word() -> str:
    """Return a random word for a page's address."""
    return secrets.token_urlsafe(16)


def derive_secret(reader: Reader, word: str) -> str:
    """Return the secret that is derived from the reader's session and the word."""
    return base64.urlsafe_b64encode(hmac.digest(reader.link_key, word.encode(), "sha256")).decode().rstrip("=")


def find_created_link(request: Request, context: WebContext, reader: Reader, word: str) -> CreatedLink | None:
    """Return the link for a word, or None if it does not exist, was used or has expired."""
    link = sign_in_links.find_link(context.service, derive_secret(reader, word)) if word else None
    if link is None:
        return None
    return CreatedLink(build_sign_in_url(request, context, link.secret), link.person_id, link.name, link.expires_at)


def build_sign_in_url(request: Request, context: WebContext, secret: str) -> str:
    """Return the URL that exchanges a link's secret for a session."""
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return f"{start}/sign-in/{secret}"
