"""Two hundred damaged and odd notebooks: each is graded, or refused with one sentence."""

from __future__ import annotations

import codecs
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from notebook_builder import MESSAGING, document
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from sim.errors import UsageError
from submissions.assignment.definition import Assignment
from submissions.assignment.reader import read_assignment
from submissions.bundle import read_submission

ASSIGNMENT = """
id = "mutants"
title = "Mutants"
[[scenario]]
id = "one"
poses = [[300, 700, 0]]
seconds = 2
[limits]
responder_cpu = 2
output_bytes = 20000
[[criterion]]
title = "Ends"
marks = 1
check = "finishes"
"""
CELLS = (
    "from nbev3devsim.load_nbev3devwidget import roboSim, eds\n%load_ext nbev3devsim",
    "import re\ndef parser(msg):\n    return re.sub('^PY::', '', msg)",
    "%%writefile logger.txt\n# log\n",
    "def echo_responder(msg):\n    return f'saw {parser(msg)}'",
    "roboSim.pyresponder = echo_responder",
    '%%sim_magic_preloaded -b Loop -x 100 --collab -RO\nimport time\nprint("PY::1")\ntime.sleep(1)\nsay("all done")',
    "%cat logger.txt",
    "%sim_magic --collab -RO -x 200 -y 300",
)
Document = dict[str, Any]
Change = Callable[[Document, random.Random], object]


def cells_of(whole: Document) -> list[Any]:
    cells: list[Any] = whole["cells"]
    return cells


def some_cell(whole: Document, chance: random.Random) -> dict[str, Any]:
    cells = [cell for cell in cells_of(whole) if isinstance(cell, dict)]
    return chance.choice(cells) if cells else {}


def add(whole: Document, chance: random.Random, source: object) -> None:
    cells = cells_of(whole)
    cells.insert(chance.randint(0, len(cells)), {"cell_type": "code", "metadata": {}, "source": source, "outputs": []})


def _many_times(whole: Document, chance: random.Random, source: str) -> None:
    for _ in range(100):
        add(whole, chance, source)


def version_3(whole: Document, chance: random.Random) -> Document:
    cells = [{**cell, "input": cell["source"]} for cell in cells_of(whole) if "source" in cell]
    for cell in cells:
        del cell["source"]
    return {"worksheets": [{"cells": cells}], "nbformat": chance.choice([2, 3]), "metadata": {"name": ""}}


def deeply(depth: int) -> list[Any]:
    nested: list[Any] = []
    for _ in range(depth):
        nested = [nested]
    return nested


#: Changes to the document. Each returns a new document, or changes its argument and returns None.
CHANGES: tuple[Change, ...] = (
    lambda whole, chance: cells_of(whole).pop(chance.randrange(len(cells_of(whole)))) and None,
    lambda whole, chance: chance.shuffle(cells_of(whole)),
    lambda whole, chance: cells_of(whole).insert(0, chance.choice([None, 7, "cell", [], {}, True])),
    lambda whole, chance: whole.update(cells=chance.choice([None, "cells", {}, 3, {"0": {}}])),
    lambda whole, chance: whole.pop("cells") and None,
    lambda whole, chance: some_cell(whole, chance).pop("cell_type", None) and None,
    lambda whole, chance: some_cell(whole, chance).update(cell_type=chance.choice(["raw", "heading", 4, None, "?"])),
    lambda whole, chance: some_cell(whole, chance).pop("source", None) and None,
    lambda whole, chance: some_cell(whole, chance).update(source=chance.choice([None, 5, {}, [1], [["a"]], [None]])),
    lambda whole, chance: some_cell(whole, chance).update(source="print('one text')\nx = 1\n"),
    lambda whole, chance: some_cell(whole, chance).update(source=["\r\n".join(["x = 1", "print(x)", ""])]),
    lambda whole, chance: some_cell(whole, chance).update(metadata=chance.choice([None, [], {"tags": "one"}])),
    lambda whole, chance: some_cell(whole, chance).update(outputs=[{"text": ["x" * 100] * 2000}] * 20),
    lambda whole, chance: some_cell(whole, chance).update(id="same", attachments={"a.png": {"image/png": "x" * 10**5}}),
    lambda whole, chance: [cell.update(id="same") for cell in cells_of(whole)] and None,
    lambda whole, chance: version_3(whole, chance),
    lambda whole, chance: whole.update(nbformat=chance.choice([0, 1, 5, 99, "4", None]), nbformat_minor=-3),
    lambda whole, chance: whole.update(metadata=chance.choice([None, [], {"language_info": {"name": "R"}}, {"a": 1}])),
    lambda whole, chance: whole.update(metadata={"deep": deeply(400)}),
    lambda whole, chance: add(whole, chance, "%nonsense -x 5 'open"),
    lambda whole, chance: add(whole, chance, "%%sim_magic_preloaded --nope\nprint(1)"),
    lambda whole, chance: add(whole, chance, "%%sim_magic_preloaded -x one\nprint(1)"),
    lambda whole, chance: add(whole, chance, "%%sim_magic_preloaded -x 'one\nprint(1)"),
    lambda whole, chance: add(whole, chance, "%sim_magic -R -x {1/0} -y $nobody {unbalanced"),
    lambda whole, chance: add(whole, chance, "%%\n%\n!\n?\n%%%\n! \\"),
    lambda whole, chance: add(whole, chance, "x = '\0'"),
    lambda whole, chance: add(whole, chance, "x = '\ud800'\nprint(x)"),
    lambda whole, chance: add(whole, chance, "print('flood' * 10000)"),
    lambda whole, chance: add(whole, chance, "(" * 300 + ")" * 300),
    lambda whole, chance: add(whole, chance, "[" * 5000),
    lambda whole, chance: add(whole, chance, "-" * 50000 + "1"),
    lambda whole, chance: add(whole, chance, "raise BaseException('odd')"),
    lambda whole, chance: add(whole, chance, "class E(Exception):\n    def __str__(self): return 1/0\nraise E()"),
    lambda whole, chance: add(whole, chance, "get_ipython = None\nprint = None"),
    lambda whole, chance: add(whole, chance, "roboSim = None\nglobals().clear()"),
    lambda whole, chance: add(whole, chance, "roboSim.pyresponder = 'no function'"),
    lambda whole, chance: add(whole, chance, "def echo_responder(msg): return None"),
    lambda whole, chance: add(whole, chance, "import os\nos._exit(3)"),
    lambda whole, chance: add(whole, chance, "%%sim_magic\n" + "#" * 70000),
    lambda whole, chance: add(whole, chance, "%%sim_magic_preloaded -R\nimport time\nwhile True: time.sleep(1)"),
    lambda whole, chance: add(whole, chance, "await something()"),
    lambda whole, chance: add(whole, chance, "\ufeff%%sim_magic_imports -R\nprint('hello')"),
    lambda whole, chance: add(whole, chance, "get_ipython().run_cell_magic('sim_magic', '-R', 'x')" * 2),
    lambda whole, chance: add(whole, chance, "get_ipython().run_line_magic(5, None)\nget_ipython().run_cell_magic()"),
    lambda whole, chance: _many_times(whole, chance, "import os\nos.listdir('..')"),
)


def text_mutations(text: str, chance: random.Random) -> bytes:
    """Return the document's text, damaged or in another encoding."""
    data = text.encode("utf-8", "surrogatepass")
    match chance.randrange(11):
        case 0:
            return codecs.BOM_UTF8 + data
        case 1:
            return text.encode("utf-16", "surrogatepass")
        case 2:
            return text.encode("utf-16-le", "surrogatepass")
        case 3:
            return text.replace("1", "é").encode("latin-1", "replace")
        case 4:
            return data.replace(b"\n", b"\r\n")
        case 5:
            return data[: chance.randrange(len(data))]
        case 6:
            place = chance.randrange(len(data))
            return data[:place] + bytes([chance.randrange(256)]) + data[place + 1 :]
        case 7:
            place = chance.randrange(len(data))
            return data[:place] + b"\0" + data[place:]
        case 8:
            return data + data
        case 9:
            return b"[" * chance.choice([10, 10**6]) + data
        case _:
            return chance.choice(
                [b"", b"null", b"[]", b"{}", b'"x"', b"NaN", b"%%sim_magic", bytes(100), b"PK\x03\x04"]
            )


def mutant(number: int) -> bytes:
    """Return one of the notebooks. The same number gives the same bytes."""
    chance = random.Random(number)
    whole = document(CELLS) if number % 10 else json.loads(MESSAGING.read_text())
    if number % 4 == 3:
        return text_mutations(json.dumps(whole, indent=1), chance)
    for _ in range(1 + number % 2):
        # Every change is used in turn, sometimes with a second one.
        change = CHANGES[number % len(CHANGES)] if _ == 0 else chance.choice(CHANGES)
        if isinstance(whole.get("cells"), list) and cells_of(whole):
            changed = change(whole, chance)
            whole = changed if isinstance(changed, dict) else whole
    return json.dumps(whole, indent=1).encode("ascii")


@pytest.fixture(scope="module")
def marked_assignment(tmp_path_factory: pytest.TempPathFactory) -> Assignment:
    folder = tmp_path_factory.mktemp("mutants")
    (folder / "assignment.toml").write_text(ASSIGNMENT)
    return read_assignment(folder)


def handled(path: Path, marked_assignment: Assignment, runner: TrialRunner) -> str:
    """Return ``graded``, or the sentence of the refusal."""
    try:
        submission = read_submission(path, required_parts=marked_assignment.parts)
    except UsageError as refusal:
        sentence = str(refusal)
        assert "\n" not in sentence
        assert sentence.startswith(path.name)
        assert "expected" in sentence
        assert len(sentence) < 300
        return sentence
    result = grade(submission, marked_assignment, runner=runner)
    assert len(result.trials) == 1
    assert result.verdict not in ("host_error", "assignment_error")
    return "graded"


@pytest.mark.parametrize("group", [pytest.param(each, marks=[pytest.mark.long] * (each > 0)) for each in range(4)])
def test_each_is_graded_or_refused_with_one_sentence(
    group: int, tmp_path: Path, marked_assignment: Assignment, runner: TrialRunner
) -> None:
    outcomes = []
    for number in range(group * 50, group * 50 + 50):
        path = tmp_path / f"mutant-{number}.ipynb"
        path.write_bytes(mutant(number))
        outcomes.append(handled(path, marked_assignment, runner))
    assert 15 < outcomes.count("graded") < 48


def test_sizes_have_a_limit_and_a_sentence(tmp_path: Path, marked_assignment: Assignment, runner: TrialRunner) -> None:
    path = tmp_path / "large.ipynb"
    whole = document(CELLS)
    whole["cells"][0]["outputs"] = [{"data": {"image/png": "A" * (50 << 20)}}]
    path.write_text(json.dumps(whole))
    assert "is too large, expected at most 16 MB a file; clear its outputs" in handled(path, marked_assignment, runner)
    path.write_text('{"cells": [' + "[]," * 4_000_000 + "[]]}")
    assert "has too much output in it" in handled(path, marked_assignment, runner)
    path.write_text(json.dumps(document(["x = 1"] * 10_000)))
    assert "has 10000 code cells, expected at most 5000" in handled(path, marked_assignment, runner)
    path.write_text(json.dumps(document([*CELLS, "# " + "x" * (1 << 20)])))
    assert "has too much code, expected at most 1 MB" in handled(path, marked_assignment, runner)


def test_thousands_of_cells_are_run(tmp_path: Path, marked_assignment: Assignment, runner: TrialRunner) -> None:
    path = tmp_path / "long.ipynb"
    path.write_text(json.dumps(document([*["x = 1"] * 4_900, *CELLS])))
    assert handled(path, marked_assignment, runner) == "graded"
