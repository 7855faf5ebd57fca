"""Runs a seccomp filter as the kernel does, and returns its decision for a system call."""

from __future__ import annotations

import errno
import struct
from collections.abc import Iterator, Sequence

from paths import DATA

X86_64, I386, AARCH64 = 0xC000003E, 0x40000003, 0xC00000B7
#: The golden list: number, name and decision, one call a line.
LIST = DATA / "expected" / "system-calls.txt"


def decide(program: bytes, number: int, arguments: Sequence[int] = (), architecture: int = X86_64) -> str:
    """Return ``allow``, ``kill``, ``ask`` or the name of the error. ``arguments`` are whole 64-bit registers."""
    full = [*arguments, *[0] * (6 - len(arguments))]
    data = struct.pack("=IIQ6Q", number & 0xFFFFFFFF, architecture, 0x7F0000001234, *full)
    code = list(struct.iter_unpack("=HBBI", program))
    accumulator = place = 0
    for _ in range(len(code)):
        operation, if_true, if_false, value = code[place]
        place += 1
        match operation:
            case 0x20:
                accumulator = struct.unpack_from("=I", data, value)[0]
            case 0x54:
                accumulator &= value
            case 0x15:
                place += if_true if accumulator == value else if_false
            case 0x35:
                place += if_true if accumulator >= value else if_false
            case 0x45:
                place += if_true if accumulator & value else if_false
            case 0x06:
                return _named(value)
            case _:
                raise AssertionError(f"an instruction that this machine does not know: {operation:#x}")
    raise AssertionError("the filter does not end")


def _named(value: int) -> str:
    match value & 0xFFFF0000:
        case 0x7FFF0000:
            return "allow"
        case 0x80000000:
            return "kill"
        case 0x7FC00000:
            return "ask"
        case 0x00050000:
            return errno.errorcode[value & 0xFFFF]
    raise AssertionError(f"a decision that this machine does not know: {value:#x}")


def listed() -> Iterator[tuple[int, str, str]]:
    """Yield number, name and decision of each call in the golden list."""
    for line in LIST.read_text().splitlines():
        if line and not line.startswith("#"):
            number, name, decision = line.split(maxsplit=2)
            yield int(number), name, decision
