"""Processor affinity: a worker and its student process share one processor during a trial, with warm caches.

This only improves speed. If every processor is taken by another trial, the processes stay unpinned.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import socket
from collections.abc import Iterator, Set

#: Processors for worker processes that serve more than one trial.
ALLOWED = frozenset(os.sched_getaffinity(0))
_libc = ctypes.CDLL(None)


@contextlib.contextmanager
def one_processor() -> Iterator[None]:
    """Within this context, pin this thread and the children forked for it to a processor unused by other trials."""
    allowed = os.sched_getaffinity(0)
    if len(allowed) == 1:
        yield
        return
    with contextlib.ExitStack() as kept:
        processor = _reserve_processor(allowed, kept)
        if processor is not None:
            os.sched_setaffinity(0, {processor})
            kept.callback(os.sched_setaffinity, 0, allowed)
        yield


def _reserve_processor(allowed: Set[int], kept: contextlib.ExitStack) -> int | None:
    """Reserve a free processor until ``kept`` is closed, preferably the current one. Return None if none is free."""
    here = _libc.sched_getcpu()
    for processor in sorted(allowed, key=lambda each: each != here):
        taking = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            # An abstract socket name is released when its process ends, for whatever reason.
            taking.bind(f"\0robomark-processor-{processor}")
        except OSError:
            taking.close()
        else:
            kept.enter_context(taking)
            return processor
    return None
