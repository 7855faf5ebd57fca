"""The language in which a reader of the pages gets them. What languages there are is ``service/language.py``'s."""

from __future__ import annotations

from babel.core import negotiate_locale
from fastapi import Request

from service.language import SOURCE, Language, language_called, languages

COOKIE = "language"


def language_of(request: Request) -> Language:
    """What the reader chose, else what the browser asks for, else English."""
    chosen = request.cookies.get(COOKIE, "")
    if chosen in languages():
        return language_called(chosen)
    asked = [part.split(";")[0].strip() for part in request.headers.get("accept-language", "")[:200].split(",")]
    return language_called(negotiate_locale([code for code in asked if code], list(languages()), sep="-") or SOURCE)
