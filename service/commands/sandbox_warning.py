"""The warning that is always shown when student code runs without the sandbox."""

from __future__ import annotations

import sys


def warn_about_missing_sandbox() -> None:
    """Print the warning. ``--quiet`` does not suppress it."""
    print("robomark: NO SANDBOX: these submissions can read and change all your files", file=sys.stderr)
