"""Languages of pages and reports: English as in the source, others from catalogues in ``locale``.

The caller chooses the language for a reader.
"""

from __future__ import annotations

import gettext
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from sim.sentences import Sentence

SOURCE_LANGUAGE = "en"


@dataclass(frozen=True, slots=True, eq=False)
class Language:
    """A language, passed to every function that creates sentences."""

    code: str
    catalogue: gettext.NullTranslations

    def say(self, sentence: str, /, **parts: object) -> str:
        """Translate a sentence. ``%(name)s`` is replaced by a part, and ``%%`` by a per cent sign."""
        return self.catalogue.gettext(sentence) % parts

    def translate_sentence(self, sentence: str) -> str:
        """Translate a sentence created elsewhere, including nested sentences; its values remain. Other text stays."""
        if not isinstance(sentence, Sentence):
            return sentence
        template = self.translate_template(sentence.template) if sentence.template else ""
        if not sentence.values:
            return template
        translated_parts = {
            name: self.translate_sentence(part) if isinstance(part, Sentence) else part
            for name, part in sentence.values.items()
        }
        return Sentence(template, **translated_parts)

    def translate_template(self, template: str) -> str:
        """Return the translated template. A clause (``make_clause``) may have only the translation of its sentence."""
        capitalised = template[:1].upper() + template[1:]
        for known_template in dict.fromkeys((template, capitalised, f"{template}.", f"{capitalised}.")):
            translation = self.catalogue.gettext(known_template)
            if translation != known_template:
                return translation.removesuffix(".") if known_template[-1] != template[-1] else translation
        return template

    def counted(self, singular: str, plural: str, count: int, /, **parts: object) -> str:
        """Translate a sentence in the singular or plural; ``count`` is available as a part."""
        return self.catalogue.ngettext(singular, plural, count) % {"count": count, **parts}

    def format_integer(self, number: int) -> str:
        """Format an integer with thousands separators; outside English, with spaces instead of commas."""
        return (
            f"{number:,}" if self.code == SOURCE_LANGUAGE else f"{number:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
        )


ENGLISH = Language(SOURCE_LANGUAGE, gettext.NullTranslations())


def translatable(sentence: str) -> str:
    """Mark a sentence for translation and return it unchanged."""
    return sentence


@lru_cache(maxsize=1)
def list_languages() -> Mapping[str, str]:
    """Return the available languages: a mapping of codes to their own names."""
    # Imported here, because it is slow and English does not need it.
    from importlib.resources import files

    from babel.core import Locale

    folder = files("service").joinpath("locale")
    codes = [
        SOURCE_LANGUAGE,
        *sorted(each.name.removesuffix(".po") for each in folder.iterdir() if each.name.endswith(".po")),
    ]
    return MappingProxyType({code: str(Locale.parse(code).get_display_name(code)).capitalize() for code in codes})


@lru_cache(maxsize=16)
def load_language(code: str) -> Language:
    """Return the language with this code."""
    if code == SOURCE_LANGUAGE:
        return ENGLISH
    import io
    from importlib.resources import files

    from babel.messages.mofile import write_mo
    from babel.messages.pofile import read_po

    source = files("service").joinpath("locale", f"{code}.po").read_bytes()
    compiled_catalogue = io.BytesIO()
    write_mo(compiled_catalogue, read_po(io.BytesIO(source)))
    compiled_catalogue.seek(0)
    return Language(code, gettext.GNUTranslations(compiled_catalogue))
