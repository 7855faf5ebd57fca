"""Keeps the languages' catalogues up with what is said: ``python -m service.message_catalogue`` writes what is new.

Which languages there are, and how they are spoken, is ``language.py``'s.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.pofile import read_po, write_po

from service.language import SOURCE, languages

#: What speaks to readers in their own language; all else speaks English.
_METHODS = [
    ("web/templates/**.html", "jinja2"),
    ("reports/templates/**.html", "jinja2"),
    ("web/**.py", "python"),
    ("reports/**.py", "python"),
    ("operations/**.py", "python"),
    ("grading/endings.py", "python"),
]
#: What is refused of what students send: who raises it does not know who reads it.
_RAISED = [
    (f"{name}.py", "python")
    for name in (
        "operations/**",
        "store/batches/intake",
        "store/grades/appeals",
        "store/grades/comments",
        "store/grades/overrides",
        "store/people/lti",
        "store/queue/tryouts",
        "web/pages/mine",
    )
]
_RAISED_OF_FILES = [
    (f"{name}.py", "python")
    for name in (
        "bundle",
        "file_kinds",
        "marked_run",
        "notebook",
        "raw_files",
        "source_text",
        "submission",
    )
]
_KEYWORDS = {"_": None, "translatable": None, "say": None, "gettext": None, "ngettext": (1, 2), "counted": (1, 2)}
_KEYWORDS |= {"Sentence": None}
_RAISING = {"Sentence": None, "UsageError": None, "LacksPart": None, "MarksChanged": None, "StudentsKnowAnother": None}
_RAISING |= {"NotFound": None, "Forbidden": None, "Conflict": None, "Invalid": None, "UnknownPlatform": None}
_OPTIONS = {pattern: {"silent": "false", "trimmed": "true"} for pattern, kind in _METHODS if kind == "jinja2"}


def messages() -> Catalog:
    """Everything that pages and reports say, with the places where."""
    catalogue = Catalog(project="Robomark", charset="utf-8")
    service, submissions = (Path(str(files(package))) for package in ("service", "submissions"))
    told = [
        *extract_from_dir(service, _METHODS, _OPTIONS, keywords=_KEYWORDS),
        *extract_from_dir(service, _RAISED, keywords=_RAISING),
        *extract_from_dir(submissions, _RAISED_OF_FILES, keywords=_RAISING),
    ]
    for name, line, message, comments, context in told:
        catalogue.add(message, None, [(name, line)], auto_comments=comments, context=context)
    return catalogue


def catalogue_file(code: str) -> Path:
    """Where the catalogue of a language is."""
    return Path(str(files("service"))) / "locale" / f"{code}.po"


def update(code: str) -> Catalog:
    """A language's catalogue with all that is said now; what is said no more is gone."""
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
