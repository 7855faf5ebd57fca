"""Conversion of submitted files (a .py file, a notebook, a folder, a .zip) to a ``Submission``.

``raw_files.py`` reads files safely, ``stored_submission.py`` stores submissions, and the assignment defines how they
are marked.
"""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from responders.source_file import SourceFile
from sim.errors import UsageError
from sim.sentences import Sentence, join_with_and
from submissions.file_kinds import advise_on_kind, advise_on_names, is_compiled
from submissions.marked_run import find_run, find_runs
from submissions.notebook import is_script, read_notebook, read_script
from submissions.part_notes import PART_WORDS, build_missing_part_note, build_part_use_note
from submissions.raw_files import RawFiles, read_folder, read_single_file, read_zip, sanitise_name
from submissions.source_text import decode_source
from submissions.student_names import MAX_NAME_LENGTH, normalise_name
from submissions.submission import (
    META_FILE,
    PART_FILES,
    SECOND_PROGRAM,
    Notebook,
    Part,
    Submission,
    find_agent,
    get_meta_run,
    get_meta_text,
    read_meta,
)

if TYPE_CHECKING:
    from submissions.assignment.definition import Parts

_NAMES: Mapping[str, Part] = MappingProxyType(
    {"robot.py": "program", "program.py": "program", "responder.py": "responder"}
)
_NOTEBOOK = ".ipynb"
_LOOKS_LIKE_RESPONDER = re.compile(
    r"^def[ \t]+(?:responder|\w+_responder)[ \t]*\("
    r"|^responder[ \t]*="
    r"|^[ \t]*roboSim\.pyresponder[ \t]*=",
    re.MULTILINE,
)
_WRITEFILE = re.compile(r"\s*%%(?:writefile|file)[ \t]+(?P<name>[A-Za-z0-9_.]+)[ \t]*\n")
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
            raise UsageError(Sentence("%(advice)s.", {"advice": advice}))
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
    if path.suffix.lower() == ".py" and path.name.lower() in _NAMES:
        return path.parent.name
    return path.name if path.is_dir() else path.stem


def fit_parts(submission: Submission, required_parts: Parts, *, source_name: str | None = None) -> Submission:
    """Adapt the submission to an assignment with these parts.

    A single file with another name than robot.py or responder.py becomes the one part that is asked for. Parts that the
    assignment provides or does not use are omitted with a note. If one of two parts is missing, a note says so.

    Raises:
        UsageError: None of the parts is present.
    """
    source_name = source_name or submission.student
    if submission.notebook is not None:
        return _fit_notebook(submission, submission.notebook, required_parts, source_name)
    submission = _add_agents(submission, required_parts, source_name)
    notes = list(submission.notes)
    parts: dict[Part, SourceFile | None] = {"program": submission.program, "responder": submission.responder}
    givers: dict[Part, str] = {"program": required_parts.program, "responder": required_parts.responder}
    student_parts = [part for part, who in givers.items() if who == "student"]
    submitted_parts = [part for part, source in parts.items() if source is not None]
    if len(student_parts) == 1 and len(submitted_parts) == 1 and student_parts != submitted_parts:
        only_source = parts[submitted_parts[0]]
        if only_source is not None and only_source.name.lower() not in _NAMES:
            parts = {submitted_parts[0]: None, student_parts[0]: only_source}
            notes = [note for note in notes if note != build_part_use_note(only_source.name, submitted_parts[0])]
            notes.append(build_part_use_note(only_source.name, student_parts[0]))
    missing_parts = [part for part in student_parts if parts.get(part) is None]
    files = [PART_FILES[part] for part in missing_parts]
    needed_files = [_describe_file(PART_FILES[part], PART_WORDS[part]) for part in student_parts]
    if required_parts.second_program == "student":
        needed_files.append(_describe_file(SECOND_PROGRAM, Sentence("the second robot's program")))
        files += [SECOND_PROGRAM] if SECOND_PROGRAM not in submission.files else []
    # With two robots, both programs are needed.
    if files and (len(missing_parts) == len(student_parts) or required_parts.second_program != "none"):
        raise UsageError(
            "%(where)s: has no %(names)s, expected %(expected)s%(renamed)s.",
            where=source_name,
            names=join_with_and(files),
            expected=join_with_and(needed_files),
            renamed=advise_on_names(missing_parts, submission.files),
        )
    notes += [build_missing_part_note(part, submission.files) for part in missing_parts]
    for part, source in parts.items():
        if source is not None and part not in student_parts:
            notes.append(f"{sanitise_name(source.name)} was left out: the assignment does not need {PART_WORDS[part]}.")
            parts[part] = None
    fitted_submission = dataclasses.replace(submission, program=parts.get("program"), responder=parts.get("responder"))
    notes += [f"{name} is empty." for name in find_empty_parts(fitted_submission)]
    return dataclasses.replace(fitted_submission, notes=tuple(notes))


def find_empty_parts(submission: Submission) -> Iterator[str]:
    """Yield the names of parts that contain only whitespace."""
    for code in (submission.program, submission.responder):
        if code is not None and not code.text.strip():
            yield sanitise_name(code.name)


def find_missing_part(submission: Submission, required_parts: Parts) -> Part | None:
    """Return the missing part if one of two was submitted; None if both or neither were."""
    if (required_parts.program, required_parts.responder) == ("student", "student"):
        if submission.program is None and submission.responder is not None:
            return "program"
        if submission.responder is None and submission.program is not None:
            return "responder"
    return None


def _fit_notebook(submission: Submission, notebook: Notebook, required_parts: Parts, source_name: str) -> Submission:
    """Keep the notebook if it is needed, otherwise the files beside it."""
    parts: dict[Part, SourceFile | None] = {"program": submission.program, "responder": submission.responder}
    givers: dict[Part, str] = {"program": required_parts.program, "responder": required_parts.responder}
    if all(parts[part] is not None for part, who in givers.items() if who == "student"):
        note = f"{sanitise_name(notebook.name)} was left out: the assignment needs the other files."
        notebook_submission = dataclasses.replace(submission, notebook=None, notes=(*submission.notes, note))
        return fit_parts(notebook_submission, required_parts, source_name=source_name)
    if required_parts.program == "student":
        find_run(notebook, required_parts.cell, submission.run)
    files, notes = dict(submission.files), list(submission.notes)
    for source in (submission.program, submission.responder):
        if source is not None:
            files[source.name] = source.text.encode("utf-8", "surrogatepass")
            notes.append(f"{sanitise_name(source.name)} is not used: the notebook is run instead.")
    if required_parts.program != "student" and find_runs(notebook):
        notes.append(f"{sanitise_name(notebook.name)}: the assignment provides the robot program.")
    notebook_submission = dataclasses.replace(
        submission,
        program=None,
        responder=None,
        files=MappingProxyType(dict(sorted(files.items()))),
        notes=tuple(notes),
    )
    return _add_agents(notebook_submission, required_parts, source_name)


def _add_agents(submission: Submission, required_parts: Parts, source_name: str) -> Submission:
    """Return the submission with each agent among its files, including agents first read as another part.

    A notebook can contain an agent in a cell that begins with ``%%writefile``.

    Raises:
        UsageError: An agent is missing.
    """
    if not required_parts.agents:
        return submission
    program, responder = submission.program, submission.responder
    files, notes = dict(submission.files), list(submission.notes)
    parts: dict[Part, SourceFile | None] = {"program": program, "responder": responder}
    for part, code in parts.items():
        if code is not None and find_agent(code.name, required_parts.agents):
            files[code.name] = code.text.encode("utf-8", "surrogatepass")
            notes = [note for note in notes if note != build_part_use_note(code.name, part)]
            program = None if part == "program" else program
            responder = None if part == "responder" else responder
    for name in [
        each
        for each in files
        if required_parts.agents.get(find_agent(each, required_parts.agents) or "", "student") != "student"
    ]:
        del files[name]
        notes.append(f"{sanitise_name(name)} was left out: the assignment provides this agent.")
    if submission.notebook is not None:
        files = _collect_written_agents(submission.notebook, required_parts.agents) | files
    present_agents = {find_agent(name, required_parts.agents) for name in files}
    missing_files = [
        f"{name}.py" for name, who in required_parts.agents.items() if who == "student" and name not in present_agents
    ]
    if missing_files and submission.notebook is not None:
        raise UsageError(
            "%(where)s: has no %(missing)s; put each agent in a file beside the notebook, or in a cell that begins "
            "with %%%%writefile %(first)s.",
            where=source_name,
            missing=join_with_and(missing_files),
            first=missing_files[0],
        )
    if missing_files:
        raise UsageError(
            "%(where)s: has no %(missing)s, expected a file for each agent.",
            where=source_name,
            missing=join_with_and(missing_files),
        )
    return dataclasses.replace(
        submission,
        program=program,
        responder=responder,
        files=MappingProxyType(dict(sorted(files.items()))),
        notes=tuple(notes),
    )


def _collect_written_agents(notebook: Notebook, agents: Mapping[str, str]) -> dict[str, bytes]:
    """Return the student's agents that cells of the notebook write to files."""
    agent_files = {}
    for cell in notebook.cells:
        match = _WRITEFILE.match(cell.source)
        if match is not None and agents.get(find_agent(match["name"], agents) or "") == "student":
            agent_files[match["name"]] = cell.source[match.end() :].encode("utf-8", "surrogatepass")
    return agent_files


def _assemble_submission(raw: RawFiles, source_name: str, name: str, candidate: str) -> Submission:
    files = dict(raw.files)
    notes = list(raw.notes)
    meta = read_meta(files.pop(META_FILE, b""), source_name)
    compiled_files = [each for each, data in files.items() if is_compiled(each, data)]
    for file in compiled_files:
        del files[file]
        notes.append(f"{sanitise_name(file)} was left out: it is compiled code; submit its Python source.")
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
        notes.append(
            f"{META_FILE} names the student {sanitise_name(meta_student)}, but the student is {sanitise_name(student)}."
        )
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
    parts = {part for name in files if (part := _NAMES.get(name.lower()))}
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
        sentence = (
            error.message
            if has_prefix
            else Sentence("%(where)s: %(why)s", {"where": source_name, "why": error.message})
        )
        if not parts:
            raise UsageError(sentence) from None
        # The .py file beside it may contain the requested parts.
        notes.append(str(sentence))
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
        part = _NAMES.get(name.lower())
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
    kind_advice = Sentence("; %(advice)s", {"advice": advice}) if advice is not None else ""
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


def _describe_file(file: str, description: Sentence) -> Sentence:
    return Sentence("%(file)s (%(what)s)", {"file": file, "what": description})
