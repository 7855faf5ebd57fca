"""Flags of the notebook magics: the words of a magic line, and the switches and values in them.

``simulator_page.py`` computes the simulator settings that result from them.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace

from sim.errors import UsageError
from submissions.source_text import PREAMBLES, Preamble, find_magic_line
from submissions.suggestions import suggest_name

#: The longest line of flags, in characters. Splitting it takes time.
_MAX_ARGUMENTS_LENGTH = 2000

_VALUED = {
    "b": "background",
    "r": "robotSetup",
    "o": "obstacles",
    "x": "xpos",
    "y": "ypos",
    "a": "angle",
    "P": "pencolor",
    "N": "sensornoise",
    "M": "motornoise",
    "s": "sim",
}
_SWITCHES = {
    "h": "help",
    "u": "ultrasound",
    "p": "pendown",
    "C": "clear",
    "q": "quiet",
    "c": "chart",
    "O": "output",
    "A": "array",
    "z": "noisecontrols",
    "Z": "settings",
    "X": "positioning",
    "D": "code",
    "i": "instrumentation",
    "W": "world",
    "H": "hide",
    "R": "autorun",
    "v": "preview",
    "L": "collab",
    "S": "stop",
    "m": "move",
    "F": "refresh",
}
#: Flags that only ``%sim_magic`` has, and the flag it lacks.
_PLAIN_ONLY = frozenset({"S", "m", "F"})
_PREVIEW_CODE = "previewcode"
_LONG = {long: short for short, long in (_VALUED | _SWITCHES).items()}


@dataclass(frozen=True, slots=True)
class Flags:
    """Flags of a magic line: values by flag, and the switches that are on."""

    preamble: Preamble = "preloaded"
    values: dict[str, str] = field(default_factory=dict)
    switches: frozenset[str] = frozenset()

    def with_values(self, **values: str | None) -> Flags:
        """Return these flags with some values replaced; None leaves a value unchanged."""
        changes = {key: value for key, value in values.items() if value is not None}
        return replace(self, values=self.values | changes)

    def remove_value(self, flag: str) -> Flags:
        """Return these flags without one value."""
        return replace(self, values={key: value for key, value in self.values.items() if key != flag})


def split_program(text: str) -> tuple[Flags, str]:
    """Return the flags of a program's magic line and ``comment_out_magic``; the preloaded preamble if it has none.

    Raises:
        UsageError: A magic or a flag does not exist.
    """
    magic_line = find_magic_line(text)
    if magic_line is None:
        return Flags(), text
    return parse_magic(text.split("\n")[magic_line].lstrip("\ufeff").strip(), magic_line + 1), _comment_out_lines(
        magic_line, text
    )


def comment_out_magic(text: str) -> str:
    """Return the program with its magic line as an empty comment, so that line numbers stay the same."""
    magic_line = find_magic_line(text)
    return text if magic_line is None else _comment_out_lines(magic_line, text)


def _comment_out_lines(magic_line: int, text: str) -> str:
    lines = text.split("\n")
    lines[: magic_line + 1] = [
        "#" if line.lstrip("\ufeff \t").startswith("%") else line for line in lines[: magic_line + 1]
    ]
    return "\n".join(lines)


def parse_magic(line: str, number: int = 1) -> Flags:
    """Return the flags of a ``%%sim_magic...`` line.

    Raises:
        UsageError: A magic or a flag does not exist. The message has the line ``number``.
    """
    name, *arguments = line.lstrip("%").split(maxsplit=1) or [""]
    if name.startswith("%") and (intended_name := name.lstrip("%")[:40]):
        problem = f"there is a blank between the percent signs; expected %%{intended_name}"
        raise UsageError("line %(line)s: %(problem)s", line=number, problem=problem)
    try:
        return parse_flags(name, "".join(arguments))
    except UsageError as error:
        raise UsageError("line %(line)s: %(problem)s", line=number, problem=error.message) from None


def parse_flags(name: str, arguments: str) -> Flags:
    """Return the flags of the magic ``name``.

    Raises:
        UsageError: The magic or a flag does not exist.
    """
    if name not in PREAMBLES:
        expected = ", ".join(f"%%{known}" for known in PREAMBLES)
        hint = suggest_name(f"%%{name[:40]}", (f"%%{known}" for known in PREAMBLES))
        raise UsageError(f"%{name[:40]} is not a magic that starts a program; expected one of {expected}{hint}")
    flags = _parse_words(_split_arguments(name, arguments), PREAMBLES[name])
    foreign_flags = sorted(flags.switches & _PLAIN_ONLY)
    if name != "sim_magic" and foreign_flags:
        raise UsageError(f"%%{name} has no flag -{foreign_flags[0]}; only %sim_magic has it")
    return flags


def _split_arguments(name: str, arguments: str) -> list[str]:
    if len(arguments) > _MAX_ARGUMENTS_LENGTH:
        raise UsageError(f"the flags of %%{name} are longer than {_MAX_ARGUMENTS_LENGTH} characters")
    try:
        return shlex.split(arguments, comments=False)
    except ValueError as error:
        raise UsageError(f"the flags of %%{name} cannot be read: {str(error).lower()}") from None


def _parse_words(words: list[str], preamble: Preamble) -> Flags:
    values: dict[str, str] = {}
    switches: set[str] = set()
    remaining_words = list(words)
    while remaining_words:
        word = remaining_words.pop(0)
        if word.startswith("--"):
            long_name, separator, value = word[2:].partition("=")
            if long_name == _PREVIEW_CODE and preamble != "none":
                continue
            letter = _find_short_flag(long_name)
            if letter in _VALUED:
                values[letter] = value if separator else _take_value(remaining_words, word)
            else:
                switches.add(letter)
        elif word.startswith("-") and len(word) > 1:
            _parse_short_flags(word[1:], remaining_words, values, switches)
        else:
            raise UsageError(f"{word[:40]!r} is not a flag")
    return Flags(preamble, values, frozenset(switches))


def _find_short_flag(long_name: str) -> str:
    """Return the letter of a long flag. Like the course's magics, accept any unambiguous prefix."""
    long_names = (
        [long_name] if long_name in _LONG else [name for name in _LONG if long_name and name.startswith(long_name)]
    )
    if len(long_names) == 1:
        return _LONG[long_names[0]]
    if long_names:
        raise UsageError(f"--{long_name[:40]} may be {' or '.join(f'--{name}' for name in long_names)}")
    hint = suggest_name(f"--{long_name[:40]}", (f"--{name}" for name in _LONG))
    raise UsageError(f"there is no flag --{long_name[:40]}" + (hint or "; --help of the course's magic lists them"))


def _parse_short_flags(letters: str, remaining_words: list[str], values: dict[str, str], switches: set[str]) -> None:
    """Parse combined short flags (-HWZ). A flag with a value takes the rest of the word, or the next word."""
    for index, letter in enumerate(letters):
        if letter in _SWITCHES:
            switches.add(letter)
        elif letter in _VALUED:
            value = letters[index + 1 :].removeprefix("=")
            values[letter] = value if value else _take_value(remaining_words, f"-{letter}")
            return
        else:
            other_case = letter.swapcase()
            hint = f"; did you mean -{other_case}?" if other_case in _SWITCHES or other_case in _VALUED else ""
            raise UsageError(f"there is no flag -{letter}{hint}")


def _take_value(remaining_words: list[str], flag: str) -> str:
    if not remaining_words:
        raise UsageError(f"{flag} needs a value")
    return remaining_words.pop(0)
