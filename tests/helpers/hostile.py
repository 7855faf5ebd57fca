"""Student files that speak to the worker past our own code: forged frames, one at a time or as a flood."""

from __future__ import annotations

import struct

#: Finds the child's end of the wire, wherever our own code keeps it.
FIND_WIRE = "import gc, os\nline = next(o for o in gc.get_objects() if type(o).__qualname__ == 'Wire')\n"


def forged(frame: str) -> str:
    """A statement that writes a frame with the very number that is due."""
    return f"line._write(b''); os.write(3, b'{{\"n\":%d,' % line._sent + {frame[1:].encode()!r} + b'\\n')"


def packed(*acts: tuple[int, int, int, int, float]) -> str:
    """A statement that sends a packet of these acts, whatever they are."""
    return f"line._acts += {[struct.pack('<BBBBd', *act) for act in acts]!r}; line._write(b'')"


def flood_of_acts(*act: float) -> str:
    """A file that does the same act for ever, thousands at a stroke."""
    packed = struct.pack("<BBBBd", *act)
    return f"{FIND_WIRE}while True:\n    line._acts = [{packed!r}] * 2000\n    line._write(b'')\n"


def flood(frame: str, at_once: int = 50) -> str:
    """A file that defines ``flood()``, which writes a frame for ever, ``at_once`` at a stroke."""
    return f"""{FIND_WIRE}
def flood():
    line._write(b"")
    while True:
        n = line._sent
        data = b"".join(b'{{"n":%d,' % (n + i) + {frame[1:].encode()!r} + b"\\n" for i in range({at_once}))
        line._sent += {at_once}
        while data:
            data = data[os.write(3, data):]
"""
