"""Submissions that send endlessly, one for each kind of data that a worker might keep for a child.

``test_metering.py`` tests each one alone, ``test_crowd.py`` tests many among honest submissions.
"""

from __future__ import annotations

from dataclasses import dataclass

from hostile import FIND_WIRE, flood, flood_of_acts, forged
from sim.recording import Verdict

BIG = "x" * 60_000


def long(frame: str, length: int = len(BIG)) -> str:
    """Return a frame with its ``@`` replaced by text of this length."""
    return frame.replace("@", "x" * length)


ECHO = "def responder(text): return text\n"
NOISY = 'for i in range(100_000): print(f"PY::{i}")'
CALL = long('{"do":"call","depth":0,"caller":"a","callee":"b","argument":"@","result":"d"}')
DEEP_LIST = "JSON::[" + "[]," * 15_000 + "[]]"


@dataclass(frozen=True)
class Flood:
    """A submission that sends endlessly, and its expected end."""

    name: str
    program: str
    responder: str | None = None
    verdicts: tuple[Verdict, ...] = (Verdict.OUTPUT_LIMIT,)


_POLARITY = '{"do":"polarity","port":"outB","polarity":"@"}'
#: Texts that fill a frame from which nothing is kept, and that are expensive to parse.
_LONG_TEXTS = {"half characters": r"\ud800" * 10_800, "escapes": r"\n" * 32_000, "pairs": r"\ud83d\ude00" * 5_400}
_ENDLESS = (Verdict.CPU_LIMIT, Verdict.STALLED)


def _program(name: str, frame: str, *verdicts: Verdict, at_once: int = 50) -> Flood:
    return Flood(name, f"{flood(frame, at_once)}flood()", None, verdicts or (Verdict.OUTPUT_LIMIT,))


def _responder(name: str, frame: str, *verdicts: Verdict, at_once: int = 50) -> Flood:
    text = f"{flood(frame, at_once)}def responder(text): flood()"
    return Flood(name, 'print("PY::x")', text, verdicts or (Verdict.OUTPUT_LIMIT,))


FLOODS = [
    _program("utterances", long('{"do":"say","text":"@"}')),
    _program("short utterances", '{"do":"say","text":"x"}'),
    _program("lines", long('{"do":"print","text":"@"}')),
    _program("short lines", '{"do":"print","text":""}'),
    _program("messages to nobody", '{"do":"print","text":"PY::"}'),
    _program("images that are sent", '{"do":"print","text":"IMG_DATA"}'),
    _program("images that are logged", '{"do":"print","text":"image_data both"}'),
    _program("refusals", long('{"do":"refused","what":"@","line":1,"file":null}')),
    _program("refusals that differ in length", long('{"do":"refused","what":"@","line":null,"file":null}', 1000)),
    _program(
        "padded questions", '{@"do":"until_said"}'.replace("@", " " * 60_000), Verdict.CPU_LIMIT, Verdict.STALLED
    ),
    _program("polarities", long(_POLARITY), *_ENDLESS),
    Flood("motor commands", flood_of_acts(2, 0, 1, 3, 100.0), None, (Verdict.CPU_LIMIT,)),
    Flood("readings", flood_of_acts(0, 0, 0, 0, 1.0), None, (Verdict.TIME_LIMIT, Verdict.STALLED)),
    _responder("lines of a responder", long('{"do":"print","text":"@"}')),
    _responder("calls", CALL),
    _responder("refusals of a responder", long('{"do":"refused","what":"@","line":1,"file":null}')),
    _responder("naps", '{"do":"sleep","units":0}', Verdict.CPU_LIMIT, Verdict.STALLED),
    _responder("padded naps", "{" + " " * 65_000 + '"do":"sleep","units":0}', *_ENDLESS, at_once=1),
    *(
        _program(f"polarities of {name}", _POLARITY.replace("@", text), *_ENDLESS, at_once=1)
        for name, text in _LONG_TEXTS.items()
    ),
    Flood("long answers", NOISY, f"def responder(text): return {BIG!r}"),
    Flood("answers of a long type", NOISY, f"long = type({BIG!r}, (), {{}})\ndef responder(text): return long()"),
    Flood("errors with long words", NOISY, f"{FIND_WIRE}def responder(text):\n    "
        + forged(long('{"do":"answer","kind":"error","error":{"type":"@","text":"@","line":1,"file":null}}', 30_000))
        + "\n    line._sent += 1\n    line.send = lambda frame: None\n    raise ValueError"),
    Flood("answers that are many objects", NOISY, f"def responder(text): return {DEEP_LIST!r}"),
    Flood("short answers", NOISY, "def responder(text): return ''"),
    Flood("short errors", NOISY, "def responder(text): raise ValueError"),
]  # fmt: skip
