"""Reader of Jupyter notebooks: the code cells of an .ipynb, or of a .py file made by nbconvert.

Notebooks are not executed here. ``marked_run.py`` selects the run that is marked.
"""

from __future__ import annotations

import ast
import codecs
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sim.errors import UsageError
from sim.readers.json_text import JSONDecodeError, read_json
from sim.readers.python_source import parse_module
from sim.readers.reader_errors import TooLongNumberError, TooManyValuesError, UnreadableDataError
from sim.sentences import Sentence
from submissions.raw_files import sanitise_name
from submissions.source_text import MAX_SOURCE_BYTES, is_program_magic
from submissions.submission import Cell, Notebook

MAX_CELLS = 5000
#: Maximum number of entries in lists and tables of a notebook, because each becomes an object in memory.
_MAX_VALUES = 3_000_000
_MAX_NOTES = 10
_MAX_LOOKED_AT = 20  # lines of a Markdown cell

_SCRIPT = re.compile(r"^[ \t]*get_ipython\(\)\.run_(?:cell|line)_magic\([ \t]*['\"]sim_magic", re.MULTILINE)
#: A line that looks like the start of a robot program.
NEARLY_MAGIC = re.compile(r"[ \t\ufeff]*%*[ \t]?sim_?ma\w*(?:[ \t]+-|[ \t]*\r?$)")
#: Its percent signs and name, also with a space between them.
_BEGIN = re.compile(r"%*[ \t]?sim_?ma\w*")
_RESPONDER = re.compile(r"^def (?:\w+_)?responder\([^\n]{0,100}", re.MULTILINE)
_MAX_RAW_RESPONDERS = 3
_MARKER = re.compile(r"^#[ \t]*In[ \t]*\[[ \t\d*]*\]:?[ \t]*$")
_CELL_MAGIC_CALL = re.compile(r"^get_ipython\(\)\.run_cell_magic\(")


@dataclass(frozen=True, slots=True)
class LoadedNotebook:
    """A notebook, and notes on omitted or corrected content."""

    notebook: Notebook
    notes: tuple[str, ...] = ()


def read_notebook(data: bytes, name: str) -> LoadedNotebook:
    """Read the code cells of an .ipynb file, in any version of the format that has cells.

    Raises:
        UsageError: The file is not a notebook, has no code, is too large, or is not for Python.
    """
    text, note = _decode_text(data, name)
    notes = [note] if note else []
    document = _parse_document(text, name)
    _check_language(document, name)
    cells: list[Cell] = []
    markdown: list[int] = []
    responders: list[str] = []
    for position, raw in enumerate(_collect_raw_cells(document, name), 1):
        problem = _describe_cell_problem(raw)
        if problem:
            if len(notes) < _MAX_NOTES:
                notes.append(f"{name}: cell {position} from the top was left out: {problem}.")
            continue
        source = _read_source(raw)
        if raw["cell_type"] == "code" and source.strip():
            cells.append(Cell(len(cells) + 1, source, _read_tags(raw)))
        elif raw["cell_type"] != "code" and any(map(is_program_magic, source.split("\n", _MAX_LOOKED_AT))):
            markdown.append(position)
        elif raw["cell_type"] == "raw":
            responders += _RESPONDER.findall(source)
    notebook = Notebook(name, tuple(cells), tuple(markdown), tuple(responders[:_MAX_RAW_RESPONDERS]))
    return LoadedNotebook(_check_notebook(notebook), tuple(notes))


def _ask_for_code_cell(position: int) -> Sentence:
    """Return a sentence that asks for a code cell, for a robot program in a Markdown cell."""
    return Sentence(
        "cell %(place)s from the top has a robot program, but is a Markdown cell. Change it to a code cell",
        place=position,
    )


#: Lines of a robot program, which a cell of the responder does not have.
_ROBOT_CODE = re.compile(
    r"^[ \t]*(?:tank_(?:drive|turn)\.|say\(|print\(f?[\"'](?:PY::|IMG_DATA)|(?:from|import) ev3dev2)", re.MULTILINE
)
_RESPONDER_CODE = re.compile(r"^def (?:\w+_)?responder\(|\bpyresponder\b", re.MULTILINE)


def describe_near_program(notebook: Notebook) -> str:
    """Describe a line that is almost a program's magic, or is one in the wrong place such as a Markdown cell."""
    for position in notebook.markdown_programs:
        return Sentence("; %(near)s", near=_ask_for_code_cell(position))
    for cell in notebook.cells:
        for number, line in enumerate(cell.source.split("\n"), 1):
            match = _BEGIN.search(line[:200]) if NEARLY_MAGIC.match(line[:200]) else None
            if match is not None:
                values = {
                    "line": number,
                    "cell": cell.number,
                    "word": sanitise_name(match[0]),
                    "why": _explain_near_magic(line),
                }
                return Sentence("; line %(line)s of cell %(cell)s has %(word)s, %(why)s", **values)
    for cell in notebook.cells:
        if _ROBOT_CODE.search(cell.source) and not _RESPONDER_CODE.search(cell.source):
            return Sentence(
                "; cell %(cell)s looks like one: write %(magic)s as its first line",
                cell=cell.number,
                magic="%%sim_magic_preloaded",
            )
    return ""


def _explain_near_magic(line: str) -> Sentence:
    """Return the reason why such a line does not start a program."""
    if is_program_magic(line):
        return Sentence("below other code: make it the first line")
    if is_program_magic(f"%{line.lstrip()}"):
        return Sentence("with one %(sign)s: write two", sign="%")
    if is_program_magic(re.sub(r"^%%\s+", "%%", line.strip())):
        return Sentence("with a blank after %(signs)s: delete the blank", signs="%%")
    return Sentence("another word")


def is_script(text: str) -> bool:
    """Return whether a Python file was made by nbconvert from a notebook with robot programs."""
    return _SCRIPT.search(text) is not None


def read_script(text: str, name: str) -> Notebook:
    """Return the notebook from which nbconvert made the file ``text``.

    Raises:
        UsageError: The notebook is too large.
    """
    chunks: list[list[str]] = [[]]
    for line in text.replace("\r\n", "\n").split("\n"):
        magic = _parse_cell_magic(line)
        if magic is not None:
            chunks += [[magic], []]
        elif _MARKER.match(line):
            chunks.append([])
        else:
            chunks[-1].append(line)
    sources = ["\n".join(chunk).strip("\n") for chunk in chunks]
    code = [source for source in sources if any(map(_is_code, source.split("\n")))]
    return _check_notebook(Notebook(name, tuple(Cell(number, source) for number, source in enumerate(code, 1))))


def pack_notebook(notebook: Notebook) -> bytes:
    """Return the notebook as an .ipynb file without outputs. ``read_notebook`` gives the same cells again.

    A Raw cell with a responder is reduced to the line that defines it.
    """
    cells: list[dict[str, Any]] = [
        {
            "cell_type": "code",
            "execution_count": None,
            "metadata": {"tags": list(cell.tags)} if cell.tags else {},
            "outputs": [],
            "source": cell.source,
        }
        for cell in notebook.cells
    ]
    cells += [{"cell_type": "raw", "metadata": {}, "source": line} for line in notebook.raw_responders]
    document = {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(document, indent=1).encode("ascii")


def _decode_text(data: bytes, name: str) -> tuple[str, str]:
    """Return the text, and a note on its encoding if it is not UTF-8."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return data.decode("utf-16"), f"{name} was read as UTF-16; Jupyter saves UTF-8."
        except UnicodeDecodeError:
            raise UsageError(
                "%(name)s: is damaged UTF-16 text, expected a notebook as Jupyter saves it.", name=name
            ) from None
    try:
        return data.decode("utf-8-sig"), ""
    except UnicodeDecodeError:
        return data.decode("latin-1"), f"{name} is not UTF-8 and was read as Latin-1; save it with Jupyter."


def _parse_document(text: str, name: str) -> Mapping[str, Any]:
    if not text.strip():
        raise UsageError("%(name)s: is an empty file, expected a notebook.", name=name)
    try:
        document = read_json(text, max_values=_MAX_VALUES, strict=False)
    except TooManyValuesError:
        raise UsageError(
            "%(name)s: has too much output in it, expected a notebook whose outputs were cleared before it was saved.",
            name=name,
        ) from None
    except TooLongNumberError:
        raise UsageError(
            "%(name)s: has a number that is too long, expected a notebook as Jupyter saves it.", name=name
        ) from None
    except UnreadableDataError:
        raise UsageError(
            "%(name)s: is nested too deeply, expected a notebook as Jupyter saves it.", name=name
        ) from None
    except ValueError as error:
        line = error.lineno if isinstance(error, JSONDecodeError) else None
        location = "" if line is None else Sentence(" (line %(line)s)", line=line)
        raise UsageError(
            "%(name)s: is not a notebook: its JSON is broken%(where)s, expected one saved by Jupyter.",
            name=name,
            where=location,
        ) from None
    if not isinstance(document, dict):
        raise UsageError("%(name)s: is JSON, but not a notebook, expected one saved by Jupyter.", name=name)
    return document


def _check_language(document: Mapping[str, Any], name: str) -> None:
    metadata = _get_table(document, "metadata")
    for table, key in (("language_info", "name"), ("kernelspec", "language")):
        language = _get_table(metadata, table).get(key)
        if isinstance(language, str) and language and not language.lower().startswith(("python", "ipython")):
            raise UsageError(
                "%(name)s: is a notebook for %(language)s, expected one for Python.",
                name=name,
                language=repr(language[:40]),
            )


def _get_table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key)
    return value if isinstance(value, dict) else {}


def _collect_raw_cells(document: Mapping[str, Any], name: str) -> list[Any]:
    """Return the cells of nbformat 4, or of all worksheets in earlier formats."""
    if isinstance(document.get("cells"), list):
        return list(document["cells"])
    sheets = document.get("worksheets")
    if isinstance(sheets, list):
        return [cell for sheet in sheets if isinstance(sheet, dict) for cell in _as_list(sheet.get("cells"))]
    raise UsageError("%(name)s: has no list of cells, expected a notebook as Jupyter saves it.", name=name)


def _as_list(value: object) -> list[Any]:
    return value if isinstance(value, list) else []


def _describe_cell_problem(raw: object) -> str:
    if not isinstance(raw, dict):
        return "it is not a cell"
    if not isinstance(raw.get("cell_type"), str):
        return "it has no cell type"
    lines = _get_lines(raw)
    if raw["cell_type"] != "code" or isinstance(lines, str):
        return ""
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        return "its code is not text"
    return ""


def _get_lines(raw: Mapping[str, Any]) -> object:
    return raw["source"] if "source" in raw else raw.get("input")


def _read_source(raw: Mapping[str, Any]) -> str:
    lines = _get_lines(raw)
    text = lines if isinstance(lines, str) else _join_surrogates("".join(map(str, _as_list(lines))))
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _join_surrogates(text: str) -> str:
    """Return the text with each pair of surrogates as one character, as in a text that was not split into lines."""
    return text.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "surrogatepass")


def _read_tags(raw: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(tag for tag in _as_list(_get_table(raw, "metadata").get("tags")) if isinstance(tag, str))


def _check_notebook(notebook: Notebook) -> Notebook:
    name, cells = notebook.name, notebook.cells
    if not cells and notebook.markdown_programs:
        raise UsageError(
            "%(name)s: has no code cells; %(near)s.", name=name, near=_ask_for_code_cell(notebook.markdown_programs[0])
        )
    if not cells:
        raise UsageError("%(name)s: has no code cells, expected a notebook with Python code.", name=name)
    if len(cells) > MAX_CELLS:
        raise UsageError(
            "%(name)s: has %(count)s code cells, expected at most %(most)s.",
            name=name,
            count=len(cells),
            most=MAX_CELLS,
        )
    if sum(len(cell.source) for cell in cells) > MAX_SOURCE_BYTES:
        raise UsageError("%(name)s: has too much code, expected at most 1 MB.", name=name)
    for cell in cells:
        if "\0" in cell.source:
            raise UsageError(
                "%(name)s: has a NUL character in cell %(cell)s, expected Python source as plain text.",
                name=name,
                cell=cell.number,
            )
    return notebook


def _is_code(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _parse_cell_magic(line: str) -> str | None:
    """Return the cell of a line ``get_ipython().run_cell_magic('name', 'flags', 'body')``."""
    if not _CELL_MAGIC_CALL.match(line):
        return None
    call_arguments = list(_parse_text_arguments(line))
    if len(call_arguments) != 3:
        return None
    name, arguments, body = call_arguments
    return f"%%{name} {arguments}".rstrip() + f"\n{body}".rstrip("\n")


def _parse_text_arguments(line: str) -> Iterator[str]:
    """Yield the arguments of a call if all are texts; nothing otherwise."""
    try:
        body = parse_module(line).body
    except (SyntaxError, UnreadableDataError):
        return
    tree = body[0].value if len(body) == 1 and isinstance(body[0], ast.Expr) else None
    if isinstance(tree, ast.Call) and not tree.keywords:
        for argument in tree.args:
            if not isinstance(argument, ast.Constant) or not isinstance(argument.value, str):
                return
            yield argument.value
