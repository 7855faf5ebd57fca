"""Where the ``robomark`` command begins: nothing but the signals, so that a Ctrl-C while the rest loads is no error.

The commands are put together in ``command_line.py``.
"""

from __future__ import annotations

import sys

# With ``python -m`` or ``-c``, and by an empty entry in PYTHONPATH, the current folder is on the path. It may be one of
# submissions: no module that is imported from here on must be one of its files. Python itself has loaded ``os``.
_own = __file__.rpartition("/service/")[0]
_here = sys.modules["os"].getcwd()
sys.path[:] = [folder for folder in sys.path if folder == _own or (folder.startswith("/") and folder != _here)]

import gc  # noqa: E402
import os  # noqa: E402
import signal  # noqa: E402
from typing import NoReturn  # noqa: E402

_STOPPED = 130


def main() -> NoReturn:
    """Run the command; 0 when it did what it should, 2 for a mistake of the caller's, 3 when it could not."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    # Imports throw nothing away, and to look for garbage is a tenth of what they cost; until a command is loaded.
    gc.disable()
    from service.command_line import main as run

    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run()
    finally:
        # Nor is it looked through when Python ends, which would take a tenth of a second.
        gc.freeze()


def _stop(_number: int, _frame: object) -> NoReturn:
    """Nothing is begun yet, so nothing is to be cleared away."""
    os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, b"robomark: stopped\n")
    os._exit(_STOPPED)
