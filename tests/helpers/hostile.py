"""Student files that bypass our code on the wire to the worker: forged frames, singly or as a flood."""

from __future__ import annotations

import struct

#: Finds the child's end of the wire, wherever our code keeps it.
FIND_WIRE = "import gc, os\nline = next(o for o in gc.get_objects() if type(o).__qualname__ == 'Wire')\n"


def forged(frame: str) -> str:
    """Return a statement that writes a frame with the expected sequence number."""
    return f"line._write(b''); os.write(3, b'{{\"n\":%d,' % line._sent + {frame[1:].encode()!r} + b'\\n')"


def packed(*acts: tuple[int, int, int, int, float]) -> str:
    """Return a statement that sends a packet of these acts, valid or not."""
    return f"line._acts += {[struct.pack('<BBBBd', *act) for act in acts]!r}; line._write(b'')"


def flood_of_acts(*act: float) -> str:
    """Return a file that repeats the same act forever, thousands in each packet."""
    packed = struct.pack("<BBBBd", *act)
    return f"{FIND_WIRE}while True:\n    line._acts = [{packed!r}] * 2000\n    line._write(b'')\n"


def flood(frame: str, at_once: int = 50) -> str:
    """Return a file that defines ``flood()``, which writes a frame forever, ``at_once`` copies per write."""
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
