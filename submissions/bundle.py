"""Conversion of submitted files (a .py file, a notebook, a folder, a .zip) to a ``Submission``.

``raw_files.py`` reads files safely, ``stored_submission.py`` stores submissions, and the assignment defines how they
are marked.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from responders.source_file import SourceFile
from sim.errors import UsageError
from sim.sentences import Sentence, join_with_and
from submissions.file_kinds import advise_on_kind, advise_on_names, is_compiled
from submissions.notebook import is_script, read_notebook, read_script
from submissions.part_fitting import fit_parts
from submissions.part_notes import build_part_use_note
from submissions.raw_files import RawFiles, read_folder, read_single_file, read_zip, sanitise_name
from submissions.source_text import decode_source
from submissions.student_names import MAX_NAME_LENGTH, normalise_name
from submissions.submission import (
    META_FILE,
    PART_FILES,
    PARTS_BY_FILE,
    Notebook,
    Part,
    Submission,
    get_meta_run,
    get_meta_text,
    read_meta,
)

if TYPE_CHECKING:
    from submissions.assignment.definition import Parts

_NOTEBOOK = ".ipynb"
_LOOKS_LIKE_RESPONDER = re.compile(
    r"^def[ \t]+(?:responder|\w+_responder)[ \t]*\("
    r"|^responder[ \t]*="
    r"|^[ \t]*roboSim\.pyresponder[ \t]*=",
    re.MULTILINE,
)
UNNAMED = "unnamed"


def read_submission(path: Path, *, student: str | None = None, required_parts: Parts | None = None) -> Submission:
    """Read the submission at ``path``: a .py file, an .ipynb notebook, a folder or a .zip.

    ``student`` identifies the student; the default is the name of the file or folder. A name in the submission's own
    submission.toml is noted. With ``required_parts``, a single .py file becomes the part that the assignment asks for,
    and a submission without such a part is rejected. Without ``required_parts``, the name or the text of a single .py
    file decides its part.

    Raises:
        UsageError: The path cannot be read as a submission.
    """
    path = Path(os.path.abspath(path))  # noqa: PTH100 - resolve() would follow a link
    source_name = sanitise_name(path.name)
    if path.is_symlink():
        raise UsageError("%(where)s: is a link, expected the file or folder itself.", where=source_name)
    if not path.exists():
        raise UsageError(
            "%(where)s: does not exist, expected a .py file, a notebook, a folder or a .zip.", where=source_name
        )
    suffix = path.suffix.lower()
    if path.is_dir():
        raw = read_folder(path)
    elif suffix == ".zip":
        raw = read_zip(path)
    elif suffix in (".py", _NOTEBOOK):
        raw = RawFiles({os.fsencode(path.name).decode("utf-8", "replace"): read_single_file(path)})
    else:
        advice = advise_on_kind([path.name])
        if advice is not None:
            raise UsageError(Sentence("%(advice)s.", advice=advice))
        raise UsageError(
            "%(where)s: is of a kind that cannot be read, expected a .py file, a notebook, a folder or a .zip.",
            where=source_name,
        )
    return build_submission(raw, source_name, student or derive_student_name(path), path.parent.name, required_parts)


def build_submission(
    raw: RawFiles, source_name: str, student: str, candidate: str, required_parts: Parts | None = None
) -> Submission:
    """Return the submission in these files, for the assignment ``candidate`` unless the files name another.

    Raises:
        UsageError: As for ``read_submission``; ``source_name`` names the files in the message.
    """
    submission = _assemble_submission(raw, source_name, student, candidate)
    return submission if required_parts is None else fit_parts(submission, required_parts, source_name=source_name)


def derive_student_name(path: Path) -> str:
    """Return the student named by a file or folder. For a part such as robot.py, use the name of its folder."""
    path = Path(os.path.abspath(path))  # noqa: PTH100 - resolve() would follow a link
    if path.suffix.lower() == ".py" and path.name.lower() in PARTS_BY_FILE:
        return path.parent.name
    return path.name if path.is_dir() else path.stem


def _assemble_submission(raw: RawFiles, source_name: str, name: str, candidate: str) -> Submission:
    files = dict(raw.files)
    notes = list(raw.notes)
    meta = read_meta(files.pop(META_FILE, b""), source_name)
    compiled_files = [each for each, data in files.items() if is_compiled(each, data)]
    for file in compiled_files:
        del files[file]
        notes.append(
            f"{sanitise_name(file)} was left out: it is compiled code, or an archive with too many files; "
            "submit Python source."
        )
    if compiled_files and not files:
        raise UsageError(
            "%(where)s: has only %(names)s in it, which is not Python source, expected robot.py and responder.py.",
            where=source_name,
            names=join_with_and([sanitise_name(each) for each in compiled_files[:3]]),
        )
    if not files:
        raise UsageError("%(where)s: has no files in it, expected robot.py and responder.py.", where=source_name)
    notebook = _find_notebook(files, source_name, notes)
    parts = _find_parts(files, source_name, notes, has_no_notebook=notebook is None)
    sources: dict[Part, SourceFile] = {}
    for part, file_name in parts.items():
        decoded = decode_source(files.pop(file_name), sanitise_name(file_name))
        sources[part] = SourceFile(file_name, decoded.text)
        if decoded.note:
            notes.append(decoded.note)
    assignment = get_meta_text(meta, "assignment", source_name)
    student = normalise_name(name)[:MAX_NAME_LENGTH].strip() or UNNAMED
    meta_student = normalise_name(get_meta_text(meta, "student", source_name) or student)
    if meta_student != student:
        # Notes are shown with hidden names too, so they do not name the student.
        notes.append(f"{META_FILE} names the student {sanitise_name(meta_student)}, which is not used.")
    run = get_meta_run(meta, source_name)
    if run is not None and notebook is None:
        notes.append(f"{META_FILE} says run = {normalise_name(run)}, which is not used: there is no notebook.")
    return Submission(
        student=student,
        program=sources.get("program"),
        responder=sources.get("responder"),
        files=MappingProxyType(dict(sorted(files.items()))),
        assignment=normalise_name(assignment or candidate) or UNNAMED,
        notes=tuple(notes),
        notebook=notebook,
        run=run if notebook is not None else None,
    )


def _find_notebook(files: dict[str, bytes], source_name: str, notes: list[str]) -> Notebook | None:
    """Remove the only notebook, or the only script made by nbconvert, from the files and return it."""
    names = sorted(name for name in files if name.lower().endswith(_NOTEBOOK))
    parts = {part for name in files if (part := PARTS_BY_FILE.get(name.lower()))}
    if len(parts) == len(PART_FILES):
        for name in names:
            del files[name]
            notes.append(f"{sanitise_name(name)} is a notebook and was left out.")
        return None
    try:
        if len(names) > 1:
            listed_names = ", ".join(map(sanitise_name, names[:5]))
            raise UsageError(
                "%(where)s: has %(count)s notebooks in it (%(found)s), expected one.",
                where=source_name,
                count=len(names),
                found=listed_names,
            )
        if names:
            loaded = read_notebook(files[names[0]], sanitise_name(names[0]))
            del files[names[0]]
            notes.extend(loaded.notes)
            return loaded.notebook
    except UsageError as error:
        # Errors name the notebook, and one in a folder may have the folder's name.
        has_prefix = len(names) > 1 or sanitise_name(names[0]).startswith(source_name)
        sentence = error.message if has_prefix else Sentence("%(where)s: %(why)s", where=source_name, why=error.message)
        if not parts:
            raise UsageError(sentence) from None
        # The .py file beside it may contain the requested parts. Names of downloads can contain the student's.
        notes.append(str(sentence).removeprefix(f"{source_name}: "))
        for name in names:
            del files[name]
        return None
    scripts = [name for name in sorted(files) if name.lower().endswith(".py") and _is_script(files[name], name)]
    if len(scripts) != 1:
        return None
    notes.append(f"{sanitise_name(scripts[0])} was read as the notebook that it was exported from.")
    return read_script(decode_source(files.pop(scripts[0]), sanitise_name(scripts[0])).text, sanitise_name(scripts[0]))


def _is_script(data: bytes, name: str) -> bool:
    return b"get_ipython" in data and is_script(decode_source(data, sanitise_name(name)).text)


def _find_parts(
    files: Mapping[str, bytes], source_name: str, notes: list[str], *, has_no_notebook: bool
) -> dict[Part, str]:
    """Assign files to parts by name; with ``has_no_notebook``, also by the content of a single file or a pair."""
    parts: dict[Part, str] = {}
    for name in sorted(files):
        part = PARTS_BY_FILE.get(name.lower())
        if part is None:
            continue
        if part in parts:
            raise UsageError(
                "%(where)s: has both %(first)s and %(name)s, expected one %(part)s.",
                where=source_name,
                first=parts[part],
                name=name,
                part=PART_FILES[part],
            )
        parts[part] = name
    if parts or not has_no_notebook:
        return parts
    python = sorted(name for name in files if name.lower().endswith(".py"))
    guesses: dict[Part, list[str]] = {"program": [], "responder": []}
    for name in python[:3]:
        guesses[_guess_part(files[name], name)].append(name)
    if len(python) == 1 or (len(python) == 2 and all(len(names) == 1 for names in guesses.values())):
        guessed_parts: dict[Part, str] = {part: names[0] for part, names in guesses.items() if names}
        for part, name in guessed_parts.items():
            notes.append(build_part_use_note(name, part))
        return guessed_parts
    found_names = ", ".join(sanitise_name(name) for name in sorted(files)[:5])
    advice = advise_on_kind(sorted(files))
    kind_advice = Sentence("; %(advice)s", advice=advice) if advice is not None else ""
    rename_advice = advise_on_names(PART_FILES, files) or kind_advice
    raise UsageError(
        "%(where)s: has no robot.py or responder.py (found %(found)s), expected one or both%(renamed)s.",
        where=source_name,
        found=found_names,
        renamed=rename_advice,
    )


def _guess_part(data: bytes, name: str) -> Part:
    text = decode_source(data, sanitise_name(name)).text
    return "responder" if _LOOKS_LIKE_RESPONDER.search(text) else "program"
