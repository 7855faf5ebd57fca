"""Update of the message catalogues: ``python -m service.message_catalogue`` adds new messages.

``language.py`` defines the languages.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.pofile import read_po, write_po

from service.language import SOURCE_LANGUAGE, list_languages

#: Sources whose messages are translated; everything else is in English.
_TRANSLATED_SOURCES = [
    ("web/templates/**.html", "jinja2"),
    ("reports/templates/**.html", "jinja2"),
    ("web/**.py", "python"),
    ("reports/**.py", "python"),
    ("operations/**.py", "python"),
    ("grading/**.py", "python"),
    ("store/batches/stage_texts.py", "python"),
]
#: Sources of translated errors about submissions: the code that raises them does not know the reader.
_ERROR_SOURCES = [
    (f"{name}.py", "python")
    for name in (
        "doctor",
        "playground",
        "notebook_engine/checks",
        "operations/**",
        "store/batches/intake",
        "store/courses/open_assignments",
        "store/grades/appeals",
        "store/grades/comments",
        "store/grades/overrides",
        "store/people/lti",
        "store/queue/notebook_runs",
        "store/queue/pool_progress",
        "store/queue/test_runs",
        "store/revision",
        "version",
        "web/pages/own_assignments",
    )
]
_SUBMISSION_ERROR_SOURCES = [
    (f"{name}.py", "python")
    for name in (
        "bundle",
        "diagram_cells",
        "file_kinds",
        "marked_run",
        "notebook",
        "part_fitting",
        "raw_files",
        "source_text",
        "submission",
    )
]
_KEYWORDS = {"_": None, "translatable": None, "say": None, "gettext": None, "ngettext": (1, 2), "counted": (1, 2)}
_KEYWORDS |= {"Sentence": None}
_ERROR_KEYWORDS = {
    "Sentence": None,
    "UsageError": None,
    "MissingPart": None,
    "MarksChanged": None,
    "AssignmentAlreadySeen": None,
    "NotebookBusy": None,
}
_ERROR_KEYWORDS |= {"NotFound": None, "Forbidden": None, "Conflict": None, "Invalid": None, "UnknownPlatform": None}
_OPTIONS = {
    pattern: {"silent": "false", "trimmed": "true"} for pattern, kind in _TRANSLATED_SOURCES if kind == "jinja2"
}


def extract_messages() -> Catalog:
    """Extract all messages of pages and reports, with their locations."""
    catalogue = Catalog(project="Robomark", charset="utf-8")
    service, submissions = (Path(str(files(package))) for package in ("service", "submissions"))
    entries = [
        *extract_from_dir(service, _TRANSLATED_SOURCES, _OPTIONS, keywords=_KEYWORDS),
        *extract_from_dir(service, _ERROR_SOURCES, keywords=_ERROR_KEYWORDS),
        *extract_from_dir(submissions, _SUBMISSION_ERROR_SOURCES, keywords=_ERROR_KEYWORDS),
    ]
    for name, line, message, comments, context in entries:
        catalogue.add(message, None, [(name, line)], auto_comments=comments, context=context)
    return catalogue


def locate_catalogue(code: str) -> Path:
    """Return the catalogue file of a language."""
    return Path(str(files("service"))) / "locale" / f"{code}.po"


def update_catalogue(code: str) -> Catalog:
    """Return a language's catalogue with all current messages and without obsolete ones."""
    with locate_catalogue(code).open("rb") as file:
        catalogue = read_po(file, locale=code)
    catalogue.update(extract_messages(), no_fuzzy_matching=True)
    catalogue.obsolete.clear()
    return catalogue


def main() -> None:
    """Update every catalogue."""
    for code in list_languages():
        if code != SOURCE_LANGUAGE:
            catalogue = update_catalogue(code)
            with locate_catalogue(code).open("wb") as file:
                write_po(file, catalogue, width=100, omit_header=False, no_location=True, sort_output=True)


if __name__ == "__main__":
    main()
