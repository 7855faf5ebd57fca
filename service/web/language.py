"""Selection of the language of a page. ``service/language.py`` defines the available languages."""

from __future__ import annotations

from babel.core import negotiate_locale
from fastapi import Request

from service.language import SOURCE_LANGUAGE, Language, list_languages, load_language

COOKIE = "language"


def detect_language(request: Request) -> Language:
    """Return the language that the reader chose, else the one that the browser prefers, else English."""
    chosen_code = request.cookies.get(COOKIE, "")
    if chosen_code in list_languages():
        return load_language(chosen_code)
    accepted_codes = [
        part.split(";")[0].strip() for part in request.headers.get("accept-language", "")[:200].split(",")
    ]
    return load_language(
        negotiate_locale([code for code in accepted_codes if code], list(list_languages()), sep="-") or SOURCE_LANGUAGE
    )
