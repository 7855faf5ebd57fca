"""What a check sends: the saved notebook and the files that its code names, and nothing else of the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from notebook_builder import notebook as write_notebook
from notebook_shell import NotebookShell
from robomark_notebook.engine import EngineError
from robomark_notebook.notebook_files import read_saved_notebook

CELLS = ["from joblib import load\nMLP = load('net.joblib')\nimport helper, json", "%%sim_magic -R\nprint('x')"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("JPY_SESSION_NAME", raising=False)
    write_notebook(tmp_path / "task.ipynb", CELLS)
    for name, content in (
        ("net.joblib", "weights"),
        ("helper.py", "from second import x\nopen('table.csv')"),
        ("second.py", "x = 1"),
        ("table.csv", "1,2"),
        ("taxes.csv", "private"),
        ("other.py", "import helper"),
        ("json.txt", "no"),
    ):
        (tmp_path / name).write_text(content)
    return tmp_path


def test_files_that_the_code_names_are_sent_and_no_others(folder: Path) -> None:
    saved = read_saved_notebook("", {})
    assert saved.name == "task.ipynb"
    assert json.loads(saved.content)["cells"][0]["source"][0].startswith("from joblib")
    assert sorted(saved.files) == ["helper.py", "net.joblib", "second.py", "table.csv"]


def test_links_to_other_folders_are_not_sent(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    secret = tmp_path_factory.mktemp("elsewhere") / "net.joblib"
    secret.write_text("secret")
    (folder / "net.joblib").unlink()
    (folder / "net.joblib").symlink_to(secret)
    assert "net.joblib" not in read_saved_notebook("", {}).files


def test_the_kernel_may_know_its_notebook(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_notebook(folder / "second.ipynb", ["x = 1"])
    with pytest.raises(EngineError, match=r"There are 2 notebooks in .*Add the name of this one"):
        read_saved_notebook("", {})
    assert read_saved_notebook("", {"__vsc_ipynb_file__": str(folder / "second.ipynb")}).name == "second.ipynb"
    monkeypatch.setenv("JPY_SESSION_NAME", str(folder / "task.ipynb"))
    assert read_saved_notebook("", {}).name == "task.ipynb"
    assert read_saved_notebook("second.ipynb", {}).name == "second.ipynb"


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("none.ipynb", None, "none.ipynb cannot be read: No such file or directory."),
        ("text.ipynb", "hello", "text.ipynb is not a notebook. Save it as .ipynb and try again."),
        ("list.ipynb", "[]", "list.ipynb is not a notebook. Save it as .ipynb and try again."),
        ("large.ipynb", json.dumps({"cells": [], "x": "y" * (17 << 20)}), "large.ipynb and its files are larger than"),
    ],
)  # fmt: skip
def test_a_notebook_that_cannot_be_sent_is_refused(folder: Path, name: str, content: str | None, sentence: str) -> None:
    if content is not None:
        (folder / name).write_text(content)
    with pytest.raises(EngineError, match=sentence):
        read_saved_notebook(name, {})


def test_a_check_sends_the_saved_notebook_and_shows_the_report(notebook: NotebookShell) -> None:
    write_notebook(Path("task.ipynb"), CELLS)
    captured = notebook.run("%robomark check stop-at-line")
    assert captured.stdout.startswith("Checking task.ipynb, as saved at ")
    assert notebook.engine.sent["assignment"] == "stop-at-line"
    assert notebook.engine.sent["notebook"] == Path("task.ipynb").read_bytes()
    (report,) = captured.outputs
    assert "2 of 5 marks" in report.data["text/plain"]
    assert "Stop at the &lt;line&gt;" in report.data["text/html"]
    assert "application/vnd.jupyter.widget-view+json" in report.data


def test_a_submission_shows_its_place_in_the_queue_and_then_the_report(
    notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.sleep", lambda _seconds: None)
    write_notebook(Path("task.ipynb"), CELLS)
    captured = notebook.run("%robomark submit stop-at-line task.ipynb")
    first, *others = captured.stdout.strip().split("\n")
    assert first.startswith("Submitted task.ipynb, as saved at ")
    assert first.endswith("Receipt: R-1")
    assert others == [
        "Submissions before it in the queue: 2.",
        "Submissions before it in the queue: 1.",
        "It is being graded.",
        "The report: https://robomark.example/r/1",
    ]
    assert len(captured.outputs) == 1


def test_an_unknown_assignment_is_one_sentence(notebook: NotebookShell) -> None:
    write_notebook(Path("task.ipynb"), CELLS)
    assert notebook.run("%robomark check no-such").stderr == "UsageError: There is no assignment no-such.\n"
