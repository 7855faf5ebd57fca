"""The documentation is correct: every command runs, and every list is complete."""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest
from pydantic import BaseModel

from builders import asked_already
from command import robomark
from notebook_builder import MESSAGING
from paths import ROOT
from responders.source_file import SourceFile
from service.grading.grader import grade
from service.reports.formats import FORMATS
from service.settings import Settings
from sim.floors import OBSTACLE_PRESETS
from sim.robot import ROBOTS
from submissions.assignment.examples import locate_examples
from submissions.assignment.reader import find_assignment
from submissions.assignment.schema import (
    ChannelTable,
    HeadTable,
    LimitsTable,
    PartsTable,
    ScenarioTable,
    WorldTable,
)
from submissions.assignment.table_problems import read_table
from submissions.criteria import SCHEMAS
from submissions.criteria.common import CriterionWithStrays
from submissions.submission import Submission

EXAMPLE = locate_examples("shape-recognition") / "reference"
DOCUMENTS = sorted((ROOT / "docs").glob("*.md"))
#: The section of each kind of criterion.
SECTIONS = dict(
    re.findall(r"^### (\w+)\n(.*?)(?=^##|\Z)", (ROOT / "docs" / "criteria.md").read_text(), re.DOTALL | re.MULTILINE)
)
#: Kinds with settings that are documented under another kind.
SHARES = dict.fromkeys(("says", "messages", "replies", "resends", "in_reach"), ("prints",))


def commands(document: Path) -> Iterator[list[str]]:
    """Yield the robomark commands in the console blocks of a document."""
    for block in re.findall(r"```console\n(.*?)```", document.read_text(), re.DOTALL):
        for line in block.splitlines():
            words = shlex.split(line.removeprefix("$ "), comments=True)
            if words[:1] == ["robomark"]:
                yield words[1:]


def files_shown(document: Path) -> list[tuple[str, str]]:
    """Return the files in a document that readers copy: name and content."""
    return re.findall(r"^`(\w+\.py)`:\n\n```python\n(.*?)```", document.read_text(), re.DOTALL | re.MULTILINE)


_SHOWING = [
    pytest.param(
        document,
        marks=[
            *[pytest.mark.long] * (document.stem in ("instructors", "models", "replay", "students", "tutorial", "web")),
            *[pytest.mark.longest] * (document.stem == "instructors"),
        ],
        id=document.stem,
    )
    for document in DOCUMENTS
    if list(commands(document))
]


@pytest.mark.long
@pytest.mark.parametrize("document", _SHOWING)
def test_every_command_shown_runs(document: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "my-work")
    for name, text in files_shown(document):
        (tmp_path / "my-work" / name).write_text(text)
    shutil.copytree(EXAMPLE, tmp_path / "submissions" / "ada")
    shutil.copytree(EXAMPLE, tmp_path / "handouts")
    shutil.copy(MESSAGING, tmp_path)
    (tmp_path / "my-robots").mkdir()
    (tmp_path / "my-robots" / "robot.py").write_text("print('PY::hello')\n")
    (tmp_path / "my-robots" / "robot2.py").write_text("%%sim_magic_preloaded -x 1500 -y 500 -a 180\n")
    _download_from_moodle(tmp_path)
    home = asked_already(tmp_path / "home")
    ids: dict[str, str] = {}
    for words in commands(document):
        given = [ids.get(word, word) for word in words]
        done = robomark(*given, folder=tmp_path, ROBOMARK_HOME=str(home))
        assert done.returncode == 0, f"robomark {shlex.join(words)}\n{done.stdout}\n{done.stderr}"
        if words[:2] == ["batch", "submit"]:
            ids["BATCH"] = re.search(r"batch (\w+)", done.stdout)[1]  # type: ignore[index]
            ids["GRADE"] = re.search(r"^ada .* (\w+) *$", done.stdout, re.MULTILINE)[1]  # type: ignore[index]


def _download_from_moodle(folder: Path) -> None:
    """Write one student's folder in a zip, and the matching worksheet."""
    with zipfile.ZipFile(folder / "CS101-Robots.zip", "w") as archive:
        for file in EXAMPLE.iterdir():
            # Different from the file in the folder, which would not count as new.
            archive.writestr(f"Ada Lovelace_500000_assignsubmission_file_/{file.name}", file.read_bytes() + b"\n# 2\n")
    (folder / "people.csv").write_text("id,name,email\nada,Ada Lovelace,ada@example.org\n")
    (folder / "Grades-CS101.csv").write_text(
        "Identifier,Full name,ID number,Email address,Status,Grade,Maximum Grade,Grade can be changed,"
        "Last modified (submission),Last modified (grade),Feedback comments\n"
        "Participant 500000,Ada Lovelace,ada,ada@example.org,Submitted for grading,,12.00,Yes,-,-,\n"
    )


def test_the_pair_for_students_gets_full_marks() -> None:
    files = dict(files_shown(ROOT / "docs" / "students.md"))
    assert files.keys() == {"robot.py", "responder.py"}
    robot, responder = (SourceFile(name, files[name]) for name in ("robot.py", "responder.py"))
    grade_given = grade(Submission("ada", robot, responder), find_assignment("shape-recognition"))
    assert (grade_given.marks, grade_given.verdict) == (12, "finished")


def test_the_assignment_shown_is_in_order(tmp_path: Path) -> None:
    text = re.search(r"```toml\n(id = .*?)```", (ROOT / "docs" / "instructors.md").read_text(), re.DOTALL)
    assert text is not None
    (tmp_path / "assignment.toml").write_text(text[1])
    assignment = find_assignment(str(tmp_path))
    assert len(list(assignment.trials())) == 36
    assert assignment.max_marks == 8


@pytest.mark.parametrize("table", [HeadTable, WorldTable, PartsTable, ScenarioTable, ChannelTable, LimitsTable])
def test_every_key_of_an_assignment_is_explained_to_instructors(table: type[BaseModel]) -> None:
    text = (ROOT / "docs" / "instructors.md").read_text()
    assert [key for key in table.model_fields if not re.search(rf"\b{key}\b", text)] == []


def test_every_robot_and_set_of_obstacles_is_named_for_instructors() -> None:
    text = (ROOT / "docs" / "instructors.md").read_text()
    assert [name for name in OBSTACLE_PRESETS if f"`{name}`" not in text] == []
    assert [name for name in ROBOTS if name.removesuffix("_Wide_Eyes") not in text] == []


def test_every_kind_of_criterion_has_a_section_and_every_group_is_linked_for_instructors() -> None:
    assert SECTIONS.keys() == SCHEMAS.keys()
    groups = re.findall(r"^## (.*)\n\n### ", (ROOT / "docs" / "criteria.md").read_text(), re.MULTILINE)
    anchors = {re.sub(r"[^\w ]", "", heading).lower().replace(" ", "-") for heading in groups}
    linked = set(re.findall(r"\(criteria\.md#([\w-]+)\)", (ROOT / "docs" / "instructors.md").read_text()))
    assert anchors
    assert anchors <= linked <= anchors | SCHEMAS.keys()


def test_every_output_format_is_named_for_instructors() -> None:
    document_text = (ROOT / "docs" / "instructors.md").read_text()
    assert [name for name in FORMATS if f"`{name}`" not in document_text] == []


@pytest.mark.parametrize("kind", sorted(SCHEMAS))
def test_every_kind_of_criterion_has_a_section_with_an_example_that_is_in_order(kind: str) -> None:
    section = SECTIONS[kind]
    examples_shown = re.findall(r"```toml\n(.*?)```", section, re.DOTALL)
    assert examples_shown
    for example in examples_shown:
        table = tomllib.loads(example)
        assert table["check"] == kind
        assert isinstance(read_table(SCHEMAS[kind], table), SCHEMAS[kind])


def test_all_that_can_be_measured_is_listed_and_nothing_else() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (`.*`) \|$", SECTIONS["ranking"], re.MULTILINE)
    listed = {kind: tuple(re.findall(r"`(.+?)`", names)) for kind, names in rows}
    assert listed == {kind: schema.measures for kind, schema in SCHEMAS.items() if schema.measures}


def test_every_kind_that_looks_among_much_is_named_with_its_strays() -> None:
    text = re.search(r"^## Naming everything.*?(?=^## )", (ROOT / "docs" / "criteria.md").read_text(), re.M | re.S)
    assert text is not None
    assert [
        kind
        for kind, schema in SCHEMAS.items()
        if issubclass(schema, CriterionWithStrays) and f"`{kind}`" not in text[0]
    ] == []


@pytest.mark.parametrize("kind", sorted(SCHEMAS))
def test_every_setting_of_a_criterion_is_explained(kind: str) -> None:
    text = SECTIONS[kind] + "".join(SECTIONS[other] for other in SHARES.get(kind, ()))
    fields = SCHEMAS[kind].model_fields.items()
    settings = {field.alias or name for name, field in fields if name not in CriterionWithStrays.model_fields}
    assert not {name for name in settings - {"check"} if not re.search(rf"\b{name}\b", text)}


def test_every_setting_is_in_the_table() -> None:
    document_text = set(
        re.findall(r"^\| `ROBOMARK_([A-Z_]+)` \|", (ROOT / "docs" / "operators.md").read_text(), re.MULTILINE)
    )
    assert document_text == {each.name.upper() for each in fields(Settings)}


def test_links_between_documents_lead_somewhere() -> None:
    for document in [ROOT / "README.md", ROOT / "SECURITY.md", *DOCUMENTS, *(ROOT / "docs" / "decisions").iterdir()]:
        for target in re.findall(r"\]\((?!http)([^)#]+)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name}: {target}"
