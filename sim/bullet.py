"""One PyBullet client in this process, without a screen; it prints nothing and is closed with its owner.

PyBullet writes its greeting to the standard streams from C, so the import is done here and nowhere else.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType, TracebackType


def _import_quietly() -> ModuleType:
    """Import PyBullet with the process's stderr turned away: the greeting is printed by C code."""
    sys.stderr.flush()
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        import pybullet
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)
    return pybullet  # type: ignore[no-any-return]


pb = _import_quietly()


class Client:
    """A physics client, for the camera or for rays and contacts; use it as a context manager or call ``close``."""

    def __init__(self) -> None:
        self.id: int = pb.connect(pb.DIRECT)

    def close(self) -> None:
        """Leave Bullet; once is enough, and more does no harm."""
        if self.id >= 0:
            pb.disconnect(physicsClientId=self.id)
            self.id = -1

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
