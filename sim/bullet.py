"""PyBullet client in this process, without a display and without output.

Only this module imports PyBullet, because its C code prints a greeting on import.
"""

from __future__ import annotations

import os
import sys
from types import ModuleType, TracebackType


def _import_quietly() -> ModuleType:
    """Import PyBullet with stderr redirected, because C code prints the greeting."""
    sys.stderr.flush()
    stderr_copy, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        import pybullet
    finally:
        os.dup2(stderr_copy, 2)
        os.close(stderr_copy)
        os.close(null)
    return pybullet  # type: ignore[no-any-return]


pb = _import_quietly()


class Client:
    """Physics client for the camera, or for rays and contacts. Use it as a context manager or call ``close``."""

    def __init__(self) -> None:
        self.id: int = pb.connect(pb.DIRECT)

    def close(self) -> None:
        """Disconnect from Bullet. More than one call is harmless."""
        if self.id >= 0:
            pb.disconnect(physicsClientId=self.id)
            self.id = -1

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
