"""The temporary folder of one web server. It is removed when the server stops, or at the next start."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from responders.sandbox.private_folders import create_locked_folder, remove_stale_folders

_PREFIX = "robomark-web-"
#: Folders of earlier versions and of commands. They have no lock, so they are removed by age.
_UNLOCKED = ("robomark-upload-", "robomark-batch-", "robomark-assignment-", "robomark-people-")
_OLD_SECONDS = 24 * 3600


@contextlib.contextmanager
def own_temporary_folder() -> Iterator[Path]:
    """Use a separate folder for all temporary files of this process, and remove folders left by other processes."""
    remove_stale_folders(_PREFIX)
    _remove_old_folders()
    previous_folder = tempfile.gettempdir()
    folder, lock_descriptor = create_locked_folder(_PREFIX, 0o700)
    tempfile.tempdir = str(folder)
    try:
        yield folder
    finally:
        tempfile.tempdir = previous_folder
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock_descriptor)


def _remove_old_folders() -> None:
    for prefix in _UNLOCKED:
        for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
            # Another server may be removing the same folder.
            with contextlib.suppress(OSError):
                status = folder.lstat()
                if status.st_uid == os.getuid() and status.st_mtime < time.time() - _OLD_SECONDS:
                    shutil.rmtree(folder, ignore_errors=True)
