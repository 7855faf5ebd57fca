"""What is said, and never left out, whenever student code is let loose."""

from __future__ import annotations

import sys


def warn_of_no_sandbox() -> None:
    """Say so; ``--quiet`` does not hide it."""
    print("robomark: NO SANDBOX: these submissions can read and change everything that you can", file=sys.stderr)
