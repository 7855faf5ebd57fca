"""The extension as students install it: the wheel in a virtual environment, on another Python if there is one."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from jupyter_environment import FAULT, JupyterEnvironment, share_environment, write_task
from paths import ROOT

pytestmark = pytest.mark.long

TUTORIAL = ROOT / "docs" / "notebook.ipynb"


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> JupyterEnvironment:
    return share_environment(tmp_path_factory.getbasetemp())


def convert(environment: JupyterEnvironment, folder: Path, *words: str) -> None:
    done = environment.run("-m", "nbconvert", *words, folder=folder)
    assert done.returncode == 0, done.stderr


def test_the_python_is_another_one_if_there_is_one(environment: JupyterEnvironment, tmp_path: Path) -> None:
    done = environment.run("-c", "import sys; print(sys.version_info[:2])", folder=tmp_path)
    version = tuple(int(number) for number in re.findall(r"\d+", done.stdout))
    assert (3, 11) <= version <= (3, 13)


def test_the_course_s_modules_are_importable_without_the_extension(
    environment: JupyterEnvironment, tmp_path: Path
) -> None:
    code = "from nbev3devsim.load_nbev3devwidget import roboSim, eds; import nn_tools.network_views, blockdiag_magic"
    done = environment.run("-W", "error", "-c", f"{code}; print(roboSim.pyresponder)", folder=tmp_path)
    assert (done.stdout, done.stderr) == ("None\n", "")


def test_the_original_modules_come_first(environment: JupyterEnvironment, tmp_path: Path) -> None:
    (tmp_path / "nbev3devsim").mkdir()
    (tmp_path / "nbev3devsim" / "__init__.py").write_text("def load_ipython_extension(shell): print('the original')")
    cells = ["%load_ext robomark_notebook", "%load_ext nbev3devsim", "%robomark help", "%sim_magic -h"]
    write_task(tmp_path, cells)
    convert(environment, tmp_path, "task.ipynb", "--execute", "--allow-errors", "--to", "markdown")
    text = (tmp_path / "task.md").read_text()
    assert "the original" in text
    assert "%robomark connect" in text
    assert "Line magic function `%sim_magic` not found" in text


def test_the_tutorial_runs_on_it_and_its_check_finds_the_mistake(
    environment: JupyterEnvironment, tmp_path: Path
) -> None:
    shutil.copy(TUTORIAL, tmp_path)
    convert(environment, tmp_path, "notebook.ipynb", "--execute", "--to", "markdown")
    text = (tmp_path / "notebook.md").read_text()
    assert "Stop at the black line: 0 of 8 marks." in text or "<b>0</b> of 8 marks" in text
    assert "Answers: [4, 9, 16]" in text


def test_a_saved_notebook_shows_pictures_and_texts_as_html(environment: JupyterEnvironment, tmp_path: Path) -> None:
    write_task(tmp_path)
    words = ("--execute", "--ExecutePreprocessor.store_widget_state=False")
    convert(environment, tmp_path, "task.ipynb", *words, "--to", "notebook", "--inplace")
    assert (tmp_path / "task.ipynb").stat().st_size < 60_000
    convert(environment, tmp_path, "task.ipynb", "--to", "html")
    page = (tmp_path / "task.html").read_text()
    assert len(re.findall(r'<img[^>]* src="data:image/png;base64,', page)) == 1
    assert "answer to PY::at the start" in page
    assert FAULT in page
    assert "Stops with the left sensor wholly on the line" in page
