"""Detection of files that cannot be part of a submission: other file types, other names, compiled code.

For each of them, the module says which file to submit instead.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import PurePosixPath
from types import MappingProxyType

from sim.readers.reader_errors import UnreadableDataError
from sim.readers.zip_archive import is_zip, open_zip
from sim.sentences import Sentence, join_with_and
from submissions.raw_files import sanitise_name
from submissions.submission import PART_FILES, SECOND_PROGRAM, Part

_COPY = Sentence("copy the text of the program into a file called robot.py, and submit that file")
_SAVE = Sentence("submit the notebook itself, the .ipynb file: in Jupyter choose File, Download")
_RENAME = Sentence("if it is your program, rename it to robot.py or responder.py")
_PACK = Sentence("pack the files as a .zip, or submit them one by one")
_WORD, _PAGE, _PICTURE = Sentence("a Word document"), Sentence("an HTML page"), Sentence("a picture")
_DOCUMENT, _PDF = Sentence("a text document"), Sentence("a PDF document")
_TEXT, _ARCHIVE = Sentence("a plain text file"), Sentence("an archive that cannot be opened here")
_KINDS: Mapping[str, tuple[Sentence, Sentence]] = MappingProxyType(
    {
        ".doc": (_WORD, _COPY),
        ".docx": (_WORD, _COPY),
        ".odt": (_DOCUMENT, _COPY),
        ".rtf": (_DOCUMENT, _COPY),
        ".pages": (_DOCUMENT, _COPY),
        ".pdf": (_PDF, _COPY),
        ".jpg": (_PICTURE, _COPY),
        ".jpeg": (_PICTURE, _COPY),
        ".png": (_PICTURE, _COPY),
        ".heic": (_PICTURE, _COPY),
        ".html": (_PAGE, _SAVE),
        ".htm": (_PAGE, _SAVE),
        ".txt": (_TEXT, _RENAME),
        ".md": (_TEXT, _RENAME),
        ".rar": (_ARCHIVE, _PACK),
        ".7z": (_ARCHIVE, _PACK),
        ".tar": (_ARCHIVE, _PACK),
        ".gz": (_ARCHIVE, _PACK),
    }
)

_COMPILED = (".pyc", ".pyo", ".pyd", ".so", ".egg", ".whl")
_MODULES = (".py", *_COMPILED)
_ELF = b"\x7fELF"
#: Maximum number of archive entries read, because zipfile creates an object for each.
_MAX_ENTRIES = 2000


def advise_on_kind(names: Iterable[str]) -> Sentence | None:
    """Return advice for the first file of a type that is not a program; None if there is none."""
    for name in names:
        file_kind = _KINDS.get(PurePosixPath(name.lower()).suffix)
        if file_kind is not None:
            values = {"name": sanitise_name(name), "kind": file_kind[0], "advice": file_kind[1]}
            return Sentence("%(name)s is %(kind)s, not a program: %(advice)s", **values)
    return None


def find_similar_file(part: Part, names: Iterable[str]) -> str:
    """Return the file whose name is most similar to the part's name; empty if none is similar."""
    stem_name = PART_FILES[part].removesuffix(".py")
    texts = ((name, name.lower().removesuffix(".txt")) for name in sorted(names) if name != SECOND_PROGRAM)
    stems = {name: text.removesuffix(".py") for name, text in texts if text.endswith(".py") or text == stem_name}
    matches = difflib.get_close_matches(stem_name, stems.values(), 1, 0.75)
    return next((name for name, stem in stems.items() if stem_name in stem or stem in matches), "")


def advise_on_names(missing_parts: Iterable[Part], files: Iterable[str]) -> str:
    """Return advice to rename similar files to the missing parts; empty if no name is similar."""
    similar_files = {part: find_similar_file(part, files) for part in missing_parts}
    renames = [
        Sentence("%(name)s to %(part)s", name=sanitise_name(name), part=PART_FILES[part])
        for part, name in similar_files.items()
        if name
    ]
    return Sentence("; rename %(files)s", files=join_with_and(renames)) if renames else ""


def is_compiled(name: str, data: bytes) -> bool:
    """Return whether a file is compiled code: a compiled module, a library, or an archive of modules.

    Python would import it like any module, but it cannot be reviewed. Model files and archives of arrays are allowed.
    """
    return name.lower().endswith(_COMPILED) or data.startswith(_ELF) or _has_modules(data)


def _has_modules(data: bytes) -> bool:
    """Return whether Python could import from this archive. Archives that are too large count as such."""
    if not is_zip(BytesIO(data)):
        return False
    try:
        with open_zip(BytesIO(data), _MAX_ENTRIES) as archive:
            return any(entry.lower().endswith(_MODULES) for entry in archive.namelist())
    except UnreadableDataError:
        return True
