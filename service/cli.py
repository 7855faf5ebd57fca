"""Entry point of the ``robomark`` command: handles signals, so that Ctrl-C during imports is not an error.

``command_line.py`` assembles the commands.
"""

from __future__ import annotations

import sys

# With ``python -m`` or ``-c``, and with an empty entry in PYTHONPATH, the current folder is on the path. It may
# contain submissions, so later imports must not find its files. Python itself has already imported ``os``.
_project_folder = __file__.rpartition("/service/")[0]
_current_folder = sys.modules["os"].getcwd()
sys.path[:] = [
    folder for folder in sys.path if folder == _project_folder or (folder.startswith("/") and folder != _current_folder)
]

import gc  # noqa: E402
import os  # noqa: E402
import signal  # noqa: E402
from typing import NoReturn  # noqa: E402

_STOPPED = 130


def main() -> NoReturn:
    """Run the command. Exit status 0 for success, 2 for a mistake by the caller, 3 for a failure."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    # Imports create little garbage, and collecting it would take a tenth of their time; re-enabled once a command is
    # loaded.
    gc.disable()
    from service.command_line import main as run

    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run()
    finally:
        # Collection at exit would also take a tenth of a second.
        gc.freeze()


def _stop(_number: int, _frame: object) -> NoReturn:
    """Exit immediately: nothing has started, so there is nothing to clean up."""
    os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, b"robomark: stopped\n")
    os._exit(_STOPPED)
