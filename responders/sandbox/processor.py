"""One processor for all of a trial: a worker and a student's process take turns, each on caches that are still warm.

It is for speed alone. Where no processor is free of other trials, everything runs wherever the machine has it.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import socket
from collections.abc import Iterator, Set

#: Where a process of ours that is for more than one trial may run.
ALLOWED = frozenset(os.sched_getaffinity(0))
_libc = ctypes.CDLL(None)


@contextlib.contextmanager
def one_processor() -> Iterator[None]:
    """Meanwhile this thread, and the children forked for it, keep to one processor that no other trial keeps to."""
    allowed = os.sched_getaffinity(0)
    if len(allowed) == 1:
        yield
        return
    with contextlib.ExitStack() as kept:
        processor = _free_one(allowed, kept)
        if processor is not None:
            os.sched_setaffinity(0, {processor})
            kept.callback(os.sched_setaffinity, 0, allowed)
        yield


def _free_one(allowed: Set[int], kept: contextlib.ExitStack) -> int | None:
    """One that nobody has taken, until ``kept`` is closed: this one if it can be. None where there is none."""
    here = _libc.sched_getcpu()
    for processor in sorted(allowed, key=lambda each: each != here):
        taking = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            # A name of no file: it is free again as soon as whoever has it is gone, however that came about.
            taking.bind(f"\0robomark-processor-{processor}")
        except OSError:
            taking.close()
        else:
            kept.enter_context(taking)
            return processor
    return None
