"""Kinds of files that students submit in place of a program, by their suffix: what each is, and what to do instead.

Only names are looked at, never what is in a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePosixPath
from types import MappingProxyType

from sim.sentences import Sentence
from submissions.raw_files import shown

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


def advice_on_kind(names: Iterable[str]) -> Sentence | None:
    """What to submit in place of the first file whose kind is known to be no program; None where none is."""
    for name in names:
        known = _KINDS.get(PurePosixPath(name.lower()).suffix)
        if known is not None:
            values = {"name": shown(name), "kind": known[0], "advice": known[1]}
            return Sentence("%(name)s is %(kind)s, not a program: %(advice)s", values)
    return None
