"""The replay of a run or a check as a widget: the component of Robomark's reports, in the output of a cell."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import anywidget
import traitlets

_VIEW = "application/vnd.jupyter.widget-view+json"


def _load_script() -> str:
    """Return the module: the component's texts, its files in order of name, and its start in a notebook."""
    package = files("robomark_notebook")
    names = sorted(each.name for each in package.joinpath("component").iterdir() if each.name.endswith(".js"))
    words = json.loads(package.joinpath("replay_words.json").read_text(encoding="utf-8"))
    parts = [*(package.joinpath("component", name) for name in names), package.joinpath("widget.js")]
    code = "\n".join(part.read_text(encoding="utf-8") for part in parts)
    return f"const known = {json.dumps(words)};\nconst words = () => known;\n{code}"


def _load_style() -> str:
    package = files("robomark_notebook")
    parts = (package.joinpath("component", "replay.css"), package.joinpath("widget.css"))
    return "\n".join(part.read_text(encoding="utf-8") for part in parts)


class ReplayWidget(anywidget.AnyWidget):
    """Plays a replay below a report. Either may be empty."""

    _esm = _load_script()
    _css = _load_style()
    #: The replay's JSON, compressed with zlib.
    replay = traitlets.Bytes(b"").tag(sync=True)
    #: Escaped HTML. Its buttons of class ``watch`` open a moment of the replay.
    report = traitlets.Unicode("").tag(sync=True)


def build_view(replay: Mapping[str, Any] | None, report: str = "") -> dict[str, Any]:
    """Return the part of an output that a notebook with widgets shows: a new widget."""
    document = b"" if replay is None else zlib.compress(json.dumps(replay, separators=(",", ":")).encode())
    widget = ReplayWidget(replay=document, report=report)
    return {_VIEW: {"version_major": 2, "version_minor": 0, "model_id": widget.model_id}}
