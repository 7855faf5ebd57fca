"""The tests of the notebook's distribution import it as it is installed: from its wheel."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

from notebook_package import unpack_package
from notebook_shell import NotebookShell

_FOLDER = tempfile.TemporaryDirectory(prefix="robomark-notebook-")
_PACKAGE = unpack_package(Path(_FOLDER.name))
sys.path.insert(0, str(_PACKAGE))


@pytest.fixture(scope="session")
def package() -> Path:
    """Return the folder with the unpacked wheel."""
    return _PACKAGE


@pytest.fixture
def notebook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[NotebookShell]:
    """Yield a notebook in an empty folder with the extension, whose robots are a fake engine's."""
    from fake_engine import FakeEngine
    from robomark_notebook import session

    engine = FakeEngine()
    monkeypatch.setattr(session, "create_local_engine", lambda: engine)
    monkeypatch.setattr(session, "create_server_engine", lambda _url, _token: engine)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / ".ipython"))
    for name in ("ROBOMARK_URL", "ROBOMARK_TOKEN", "JPY_SESSION_NAME"):
        monkeypatch.delenv(name, raising=False)
    shell = InteractiveShell.instance(config=Config(HistoryManager={"enabled": False}), colors="nocolor")
    try:
        shell.run_line_magic("load_ext", "robomark_notebook")
        yield NotebookShell(shell, engine)
    finally:
        InteractiveShell.clear_instance()
        for name in [name for name in sys.modules if name.partition(".")[0] in ("nbev3devsim", "nn_tools")]:
            del sys.modules[name]
