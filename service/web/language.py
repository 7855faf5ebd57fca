"""The languages of the pages: English as written, others from their catalogues in ``locale``."""

from __future__ import annotations

import gettext
import io
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType

from babel.core import Locale, negotiate_locale
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from fastapi import Request

SOURCE = "en"
COOKIE = "language"


@lru_cache(maxsize=1)
def languages() -> Mapping[str, str]:
    """What there is, by code: what each calls itself."""
    folder = files("service.web").joinpath("locale")
    codes = [SOURCE, *sorted(each.name.removesuffix(".po") for each in folder.iterdir() if each.name.endswith(".po"))]
    return MappingProxyType({code: str(Locale.parse(code).get_display_name(code)).capitalize() for code in codes})


@lru_cache(maxsize=16)
def translations(code: str) -> gettext.NullTranslations:
    """The catalogue of a language; English has none."""
    if code == SOURCE:
        return gettext.NullTranslations()
    source = files("service.web").joinpath("locale", f"{code}.po").read_bytes()
    compiled = io.BytesIO()
    write_mo(compiled, read_po(io.BytesIO(source)))
    compiled.seek(0)
    return gettext.GNUTranslations(compiled)


def translatable(sentence: str) -> str:
    """The sentence itself: marks one that a page will show in the reader's language."""
    return sentence


def language_of(request: Request) -> str:
    """What the reader chose, else what the browser asks for, else English."""
    chosen = request.cookies.get(COOKIE, "")
    if chosen in languages():
        return chosen
    asked = [part.split(";")[0].strip() for part in request.headers.get("accept-language", "")[:200].split(",")]
    return negotiate_locale([code for code in asked if code], list(languages()), sep="-") or SOURCE
