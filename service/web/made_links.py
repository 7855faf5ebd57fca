"""A link that somebody made for somebody else, shown to its maker for as long as it counts, and kept nowhere.

It follows from the maker's session and a word in the address, so nobody else can read it off that address.
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

#: The word in an address; empty where no link is shown.
LinkWord = Annotated[str, Query(alias="link", max_length=64)]


@dataclass(frozen=True, slots=True)
class MadeLink:
    """Where it leads, whom to, and how long yet."""

    url: str
    person_id: int
    name: str
    expires_at: datetime


def new_word() -> str:
    """A word for an address."""
    return secrets.token_urlsafe(16)


def secret_word(reader: Reader, word: str) -> str:
    """What the link of an address's word is made of."""
    return base64.urlsafe_b64encode(hmac.digest(reader.link_key, word.encode(), "sha256")).decode().rstrip("=")


def made_link(request: Request, context: WebContext, reader: Reader, word: str) -> MadeLink | None:
    """The link of an address's word; None where there is none, or it was used or has expired."""
    found = sign_in_links.find_link(context.service, secret_word(reader, word)) if word else None
    if found is None:
        return None
    return MadeLink(sign_in_address(request, context, found.secret), found.person_id, found.name, found.expires_at)


def sign_in_address(request: Request, context: WebContext, secret: str) -> str:
    """Where a link's secret is exchanged for a session."""
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return f"{start}/sign-in/{secret}"
