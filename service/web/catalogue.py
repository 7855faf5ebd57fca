"""Keeps the languages' catalogues up with the pages: ``python -m service.web.catalogue`` writes what is new into each.

Which language a reader gets is ``language.py``'s.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.pofile import read_po, write_po

from service.web.language import SOURCE, languages

_METHODS = [("templates/**.html", "jinja2"), ("**.py", "python")]
_KEYWORDS = {"_": None, "translatable": None, "gettext": None, "ngettext": (1, 2)}
_OPTIONS = {"templates/**.html": {"silent": "false", "trimmed": "true"}}


def messages() -> Catalog:
    """Everything that pages say, with the places where."""
    catalogue = Catalog(project="Robomark", charset="utf-8")
    folder = Path(str(files("service.web")))
    found = extract_from_dir(folder, _METHODS, _OPTIONS, keywords=_KEYWORDS)
    for name, line, message, comments, context in found:
        catalogue.add(message, None, [(name, line)], auto_comments=comments, context=context)
    return catalogue


def catalogue_file(code: str) -> Path:
    """Where the catalogue of a language is."""
    return Path(str(files("service.web"))) / "locale" / f"{code}.po"


def update(code: str) -> Catalog:
    """A language's catalogue with all that pages say now; what they say no more is gone."""
    with catalogue_file(code).open("rb") as file:
        kept = read_po(file, locale=code)
    kept.update(messages(), no_fuzzy_matching=True)
    kept.obsolete.clear()
    return kept


def main() -> None:
    """Bring every catalogue up to date."""
    for code in languages():
        if code != SOURCE:
            updated = update(code)
            with catalogue_file(code).open("wb") as file:
                write_po(file, updated, width=100, omit_header=False, no_location=True, sort_output=True)


if __name__ == "__main__":
    main()
