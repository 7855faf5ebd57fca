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
class MadeLink:
    """A sign-in link with its owner and its time of expiry."""

    url: str
    person_id: int
    name: str
    expires_at: datetime


def new_word() -> str:
    """Return a random word for a page's address."""
    return secrets.token_urlsafe(16)


def secret_word(reader: Reader, word: str) -> str:
    """Return the secret that is derived from the reader's session and the word."""
    return base64.urlsafe_b64encode(hmac.digest(reader.link_key, word.encode(), "sha256")).decode().rstrip("=")


def made_link(request: Request, context: WebContext, reader: Reader, word: str) -> MadeLink | None:
    """Return the link for a word, or None if it does not exist, was used or has expired."""
    found = sign_in_links.find_link(context.service, secret_word(reader, word)) if word else None
    if found is None:
        return None
    return MadeLink(sign_in_address(request, context, found.secret), found.person_id, found.name, found.expires_at)


def sign_in_address(request: Request, context: WebContext, secret: str) -> str:
    """Return the URL that exchanges a link's secret for a session."""
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return f"{start}/sign-in/{secret}"
