"""Selection of the language of a page. ``service/language.py`` defines the available languages."""

from __future__ import annotations

from babel.core import negotiate_locale
from fastapi import Request

from service.language import SOURCE, Language, language_called, languages

COOKIE = "language"


def language_of(request: Request) -> Language:
    """Return the language that the reader chose, else the one that the browser prefers, else English."""
    chosen = request.cookies.get(COOKIE, "")
    if chosen in languages():
        return language_called(chosen)
    asked = [part.split(";")[0].strip() for part in request.headers.get("accept-language", "")[:200].split(",")]
    return language_called(negotiate_locale([code for code in asked if code], list(languages()), sep="-") or SOURCE)
