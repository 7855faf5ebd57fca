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
    allowed_processors = os.sched_getaffinity(0)
    if len(allowed_processors) == 1:
        yield
        return
    with contextlib.ExitStack() as stack:
        processor = _reserve_processor(allowed_processors, stack)
        if processor is not None:
            os.sched_setaffinity(0, {processor})
            stack.callback(os.sched_setaffinity, 0, allowed_processors)
        yield


def _reserve_processor(allowed_processors: Set[int], stack: contextlib.ExitStack) -> int | None:
    """Reserve a free processor until ``stack`` is closed, preferably the current one. Return None if none is free."""
    current_processor = _libc.sched_getcpu()
    for processor in sorted(allowed_processors, key=lambda each: each != current_processor):
        lock_socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            # An abstract socket name is released when its process ends, for whatever reason.
            lock_socket.bind(f"\0robomark-processor-{processor}")
        except OSError:
            lock_socket.close()
        else:
            stack.enter_context(lock_socket)
            return processor
    return None
