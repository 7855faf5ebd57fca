"""The languages that pages and reports speak: English as written, others from their catalogues in ``locale``.

Which one a reader gets is decided by whoever knows the reader; nothing here remembers it.
"""

from __future__ import annotations

import gettext
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from sim.sentences import Sentence

SOURCE = "en"


@dataclass(frozen=True, slots=True, eq=False)
class Language:
    """One of them, handed on to whatever makes sentences."""

    code: str
    catalogue: gettext.NullTranslations

    def say(self, sentence: str, /, **parts: object) -> str:
        """A sentence of ours: ``%(name)s`` in it stands for a part, and ``%%`` for a per cent sign."""
        return self.catalogue.gettext(sentence) % parts

    def tell(self, sentence: str | Sentence) -> str:
        """A sentence that was made elsewhere, with those that stand in it."""
        if isinstance(sentence, str):
            return sentence
        if not sentence.values:
            return self.catalogue.gettext(sentence.template) if sentence.template else ""
        told = {name: self.tell(part) if isinstance(part, Sentence) else part for name, part in sentence.values.items()}
        return self.say(sentence.template, **told)

    def counted(self, one: str, many: str, count: int, /, **parts: object) -> str:
        """The same, of one thing or of ``count``, which is a part of that name."""
        return self.catalogue.ngettext(one, many, count) % {"count": count, **parts}

    def whole(self, number: int) -> str:
        """A whole number as people write it: a comma between thousands is a decimal comma to many."""
        return f"{number:,}" if self.code == SOURCE else f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


ENGLISH = Language(SOURCE, gettext.NullTranslations())


def translatable(sentence: str) -> str:
    """The sentence itself: marks one that will be said in the reader's language."""
    return sentence


@lru_cache(maxsize=1)
def languages() -> Mapping[str, str]:
    """What there is, by code: what each calls itself."""
    # What reads catalogues takes long to load; English needs none of it.
    from importlib.resources import files

    from babel.core import Locale

    folder = files("service").joinpath("locale")
    codes = [SOURCE, *sorted(each.name.removesuffix(".po") for each in folder.iterdir() if each.name.endswith(".po"))]
    return MappingProxyType({code: str(Locale.parse(code).get_display_name(code)).capitalize() for code in codes})


@lru_cache(maxsize=16)
def language_called(code: str) -> Language:
    """The one of ``languages`` with this code."""
    if code == SOURCE:
        return ENGLISH
    import io
    from importlib.resources import files

    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    source = files("service").joinpath("locale", f"{code}.po").read_bytes()
    compiled = io.BytesIO()
    write_mo(compiled, read_po(io.BytesIO(source)))
    compiled.seek(0)
    return Language(code, gettext.GNUTranslations(compiled))
