"""What the documents show works: every command is run, and every list is complete."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from notebook_builder import MESSAGING
from service.settings import Settings
from submissions.assignment_file import find_assignment
from submissions.criteria import SCHEMAS
from submissions.example_folder import examples

ROOT = Path(__file__).parents[1]
EXAMPLE = examples("shape-recognition") / "reference"
DOCUMENTS = sorted((ROOT / "docs").glob("*.md"))


def commands(document: Path) -> Iterator[list[str]]:
    """The robomark commands in the console blocks of a document."""
    for block in re.findall(r"```console\n(.*?)```", document.read_text(), re.DOTALL):
        for line in block.splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True)
            if words[:1] == ["robomark"]:
                yield words[1:]


@pytest.mark.parametrize("document", [each for each in DOCUMENTS if list(commands(each))], ids=lambda path: path.stem)
def test_every_command_shown_runs(document: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "my-work")
    shutil.copytree(EXAMPLE, tmp_path / "hand-ins" / "ada")
    shutil.copy(MESSAGING, tmp_path)
    environment = os.environ | {"ROBOMARK_HOME": str(tmp_path / "home")}
    ids: dict[str, str] = {}
    for words in commands(document):
        given = [ids.get(word, word) for word in words]
        done = subprocess.run(
            [sys.executable, "-c", "from service.cli import main; main()", *given],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
        )
        assert done.returncode == 0, f"robomark {shlex.join(words)}\n{done.stdout}\n{done.stderr}"
        if words[:2] == ["batch", "submit"]:
            ids["BATCH"] = re.search(r"batch (\w+)", done.stdout)[1]  # type: ignore[index]
            ids["GRADE"] = re.search(r"^ada .* (\w+) *$", done.stdout, re.MULTILINE)[1]  # type: ignore[index]


def test_the_assignment_shown_is_in_order(tmp_path: Path) -> None:
    text = re.search(r"```toml\n(.*?)```", (ROOT / "docs" / "instructors.md").read_text(), re.DOTALL)
    assert text is not None
    (tmp_path / "assignment.toml").write_text(text[1])
    assignment = find_assignment(str(tmp_path))
    assert len(list(assignment.trials())) == 36
    assert assignment.max_marks == 8


def test_every_criterion_is_in_the_table() -> None:
    shown = set(
        re.findall(r"^\| (`[a-z_]+`(?:, `[a-z_]+`)*) \|", (ROOT / "docs" / "instructors.md").read_text(), re.MULTILINE)
    )
    assert {name for cell in shown for name in re.findall(r"[a-z_]+", cell)} >= SCHEMAS.keys()


def test_every_setting_is_in_the_table() -> None:
    shown = set(re.findall(r"^\| `ROBOMARK_([A-Z_]+)` \|", (ROOT / "docs" / "operators.md").read_text(), re.MULTILINE))
    assert shown == {name.upper() for name in Settings.model_fields}


def test_links_between_documents_lead_somewhere() -> None:
    for document in [ROOT / "README.md", *DOCUMENTS]:
        for target in re.findall(r"\]\((?!http)([^)#]+)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name}: {target}"
