"""The saved notebook and the files beside it that its code names: what a check or a submission sends.

Other files of the folder are the student's own and are not read.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robomark_notebook.engine import EngineError

_MAX_BYTES = 16 << 20
#: Where a notebook's server, or VS Code, tells the kernel which notebook it runs.
_SESSION_VARIABLE, _VSCODE_NAME = "JPY_SESSION_NAME", "__vsc_ipynb_file__"


@dataclass(frozen=True, slots=True)
class SavedNotebook:
    """A notebook as it was last saved, with the files beside it that its code names."""

    name: str
    content: bytes
    files: Mapping[str, bytes]
    saved_at: float  # seconds since 1970

    def describe(self) -> str:
        """Return a sentence on what is sent."""
        saved = time.strftime("%H:%M:%S", time.localtime(self.saved_at))
        files = f", with {', '.join(sorted(self.files))}" if self.files else ""
        return f"{self.name}, as saved at {saved}{files}"


def read_saved_notebook(argument: str, names: Mapping[str, Any]) -> SavedNotebook:
    """Read the notebook ``argument``, or the kernel's own if it is empty. ``names`` are those of the kernel.

    Raises:
        EngineError: It is unknown which notebook is meant, or a file cannot be read.
    """
    path = Path(argument) if argument else _find_notebook(names)
    try:
        content = path.read_bytes()
        saved_at = path.stat().st_mtime
    except OSError as error:
        raise EngineError(f"{path} cannot be read: {error.strerror}.") from None
    files = _read_neighbours(path, _read_code(path, content))
    if len(content) + sum(map(len, files.values())) > _MAX_BYTES:
        raise EngineError(
            f"{path.name} and its files are larger than {_MAX_BYTES >> 20} MB; clear its outputs and save it"
        )
    return SavedNotebook(path.name, content, files, saved_at)


def _find_notebook(names: Mapping[str, Any]) -> Path:
    known = names.get(_VSCODE_NAME) or os.environ.get(_SESSION_VARIABLE, "")
    if str(known).endswith(".ipynb") and Path(known).is_file():
        return Path(known)
    candidates = [path for path in sorted(Path.cwd().glob("*.ipynb")) if path.is_file()]
    if len(candidates) == 1:
        return candidates[0]
    found = f"There are {len(candidates)} notebooks" if candidates else "There is no notebook"
    raise EngineError(f"{found} in {Path.cwd()}. Add the name of this one, such as task.ipynb, at the end of the line.")


def _read_code(path: Path, content: bytes) -> str:
    try:
        cells = json.loads(content)["cells"]
        return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    except (ValueError, KeyError, TypeError):
        raise EngineError(f"{path.name} is not a notebook. Save it as .ipynb and try again.") from None


def _read_neighbours(path: Path, code: str) -> dict[str, bytes]:
    """Return the files in the notebook's folder that its code names, and the modules that those import."""
    neighbours = {each.name: each for each in sorted(path.resolve().parent.iterdir()) if _is_sendable(each)}
    files: dict[str, bytes] = {}
    remaining_text, size = code, 0
    while remaining_text:
        named = [name for name in neighbours if name not in files and _is_named(name, remaining_text)]
        remaining_text = ""
        for name in named:
            size += neighbours[name].stat().st_size
            if size > _MAX_BYTES:
                raise EngineError(f"{name} and the other files of {path.name} are larger than {_MAX_BYTES >> 20} MB.")
            files[name] = neighbours[name].read_bytes()
            if name.endswith(".py"):
                remaining_text += files[name].decode("utf-8", "replace")
    return files


def _is_sendable(path: Path) -> bool:
    return path.suffix not in ("", ".ipynb") and path.is_file() and not path.is_symlink()


def _is_named(name: str, text: str) -> bool:
    """Return whether the code names a file, or imports it as a module."""
    return name in text or (name.endswith(".py") and _imports(name.removesuffix(".py"), text.splitlines()))


def _imports(module: str, lines: Iterable[str]) -> bool:
    words = (line.replace(",", " ").split() for line in lines)
    return any(line[:1] in (["import"], ["from"]) and module in line for line in words)
