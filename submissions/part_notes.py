"""Notes on files that were used as a part, and on missing parts.

Code that removes or replaces a note creates it again for comparison, so that no code parses its text.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from sim.sentences import Sentence
from submissions.raw_files import sanitise_name
from submissions.submission import PART_FILES, Part

PART_WORDS: Mapping[Part, Sentence] = MappingProxyType(
    {"program": Sentence("a robot program"), "responder": Sentence("a responder")}
)


def build_part_use_note(name: str, part: Part) -> str:
    """Return the note that a file with another name was used as a part."""
    return f"{sanitise_name(name)} was used as {PART_WORDS[part]}."


def build_missing_part_note(part: Part, files: Mapping[str, bytes]) -> str:
    """Return the note that a part is missing; ``files`` are the other files of the submission."""
    other_files = [sanitise_name(name) for name in files if name.lower().endswith(".py")]
    other_files_text = f" (other files: {', '.join(other_files[:3])})" if other_files else ""
    return f"There is no {PART_FILES[part]}{other_files_text}; criteria that need {PART_WORDS[part]} get no marks."
