"""Update of the message catalogues: ``python -m service.message_catalogue`` adds new messages.

``language.py`` defines the languages.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.pofile import read_po, write_po

from service.language import SOURCE, languages

#: Sources whose messages are translated; everything else is in English.
_METHODS = [
    ("web/templates/**.html", "jinja2"),
    ("reports/templates/**.html", "jinja2"),
    ("web/**.py", "python"),
    ("reports/**.py", "python"),
    ("operations/**.py", "python"),
    ("grading/verdict_labels.py", "python"),
]
#: Sources of translated errors about submissions: the code that raises them does not know the reader.
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
    """Extract all messages of pages and reports, with their locations."""
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
    """Return the catalogue file of a language."""
    return Path(str(files("service"))) / "locale" / f"{code}.po"


def update(code: str) -> Catalog:
    """Return a language's catalogue with all current messages and without obsolete ones."""
    with catalogue_file(code).open("rb") as file:
        kept = read_po(file, locale=code)
    kept.update(messages(), no_fuzzy_matching=True)
    kept.obsolete.clear()
    return kept


def main() -> None:
    """Update every catalogue."""
    for code in languages():
        if code != SOURCE:
            updated = update(code)
            with catalogue_file(code).open("wb") as file:
                write_po(file, updated, width=100, omit_header=False, no_location=True, sort_output=True)


if __name__ == "__main__":
    main()
