"""A folder that Gradescope takes as its autograder: the two scripts that it runs, the assignment, and the secret.

The scripts print the output of ``robomark grade --format gradescope``.
"""

from __future__ import annotations

from importlib import resources
from pathlib import Path

from service.version import GRADER_VERSION
from sim.errors import UsageError
from submissions.assignment.export import export_for_grading
from submissions.seeds import Secret

_SCRIPTS = ("setup.sh", "run_autograder")


def write_autograder(assignment: str, folder: Path, secret: Secret) -> None:
    """Make ``folder``, which marks in the worlds of the installation that has this secret.

    Raises UsageError when the assignment cannot be used, or the folder exists or cannot be made.
    """
    if folder.exists():
        raise UsageError(f"{folder} is there already, expected a new folder")
    export_for_grading(assignment, folder / "assignment")
    try:
        for name in _SCRIPTS:
            text = resources.files(__package__).joinpath(name).read_text("utf-8")
            (folder / name).write_text(text.replace("VERSION", GRADER_VERSION), encoding="utf-8", newline="\n")
            (folder / name).chmod(0o755)
        secret_file = folder / "secret"
        secret_file.touch(0o600)
        secret_file.write_text(secret.text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{folder} cannot be written: {error.strerror}") from None
