"""The extension in real kernels: cells run from top to bottom, as nbclient and nbconvert run them."""

from __future__ import annotations

import json
from pathlib import Path

from notebook_package import FAKE_ENGINE, run_notebook, text_of


def test_a_notebook_runs_in_a_kernel(package: Path, tmp_path: Path) -> None:
    executed = run_notebook(
        tmp_path,
        package,
        [
            FAKE_ENGINE,
            "from nbev3devsim.load_nbev3devwidget import roboSim, eds\n%load_ext nbev3devsim",
            "def responder(text):\n    print('asked', text)\n    return 'answer to ' + text",
            '%%sim_magic_preloaded -ROHW --collab\nprint("PY::1")\nprint("Light: 3")',
            "%sim_data",
        ],
    )
    texts = [text_of(cell) for cell in executed.cells]
    assert texts[3].startswith("asked PY::1\n")
    assert "0.00 s  answer to PY::1" in texts[3]
    assert "Light" in texts[4]
    (run,) = [output for output in executed.cells[3].outputs if "image/png" in output.get("data", {})]
    assert "application/vnd.jupyter.widget-view+json" in run.data
    # Without the state of widgets, which few save, a run is small.
    assert len(json.dumps(executed.cells[3].outputs)) < 40_000


def test_a_mistake_ends_the_notebook_with_a_sentence(package: Path, tmp_path: Path) -> None:
    executed = run_notebook(tmp_path, package, [FAKE_ENGINE, "%sim_magic --wrong"], allow_errors=True)
    assert "UsageError: There is no flag --wrong" in text_of(executed.cells[1])
    assert "Traceback" not in json.dumps(executed.cells[1].outputs)
