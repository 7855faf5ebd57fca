"""The hash of a submission: its input can be decoded, so different submissions have different hashes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from responders.source_file import SourceFile
from submissions.submission import Cell, Notebook, Submission

#: Pairs with different hashes. They were equal when names and lengths did not precede their content.
APART = {
    "a file's name that holds another file": (
        Submission("a", files={"a:XXfile:2:b": b"YY"}),
        Submission("a", files={"a": b"XX", "b": b"YY"}),
    ),
    "one tag of two lines, and two tags": (
        Submission("a", notebook=Notebook("n.ipynb", (Cell(1, "x", ("p\nq",)),))),
        Submission("a", notebook=Notebook("n.ipynb", (Cell(1, "x", ("p", "q")),))),
    ),
    "an empty tag, and none": (
        Submission("a", notebook=Notebook("n.ipynb", (Cell(1, "x", ("",)),))),
        Submission("a", notebook=Notebook("n.ipynb", (Cell(1, "x"),))),
    ),
    "a notebook without cells, and nothing": (
        Submission("a", notebook=Notebook("n.ipynb", ())),
        Submission("a"),
    ),
    "cells of other numbers, which errors name": (
        Submission("a", notebook=Notebook("n.ipynb", (Cell(1, "x"),))),
        Submission("a", notebook=Notebook("n.ipynb", (Cell(2, "x"),))),
    ),
    "notebooks of other names, which notes have": (
        Submission("a", notebook=Notebook("ada.ipynb", (Cell(1, "x"),))),
        Submission("a", notebook=Notebook("eve.ipynb", (Cell(1, "x"),))),
    ),
    "programs of other names, which errors have": (
        Submission("a", SourceFile("ada.py", "1/0")),
        Submission("a", SourceFile("eve.py", "1/0")),
    ),
}


@pytest.mark.parametrize(("one", "other"), APART.values(), ids=APART)
def test_different_submissions_have_different_hashes(one: Submission, other: Submission) -> None:
    assert one.sha256 != other.sha256


def _read_back(data: bytes) -> list[list[bytes]]:
    """Return the records of fields that ``Submission.hashed`` wrote, decoded without knowledge of their meaning."""
    rest = memoryview(data)

    def number(word: bytes) -> int:
        nonlocal rest
        digits, _, after = bytes(rest[:30]).partition(word)
        rest = rest[len(digits) + len(word) :]
        assert after or word in data
        return int(digits)

    tag = b"robomark submission 2\n"
    assert data.startswith(tag)
    rest = rest[len(tag) :]
    records = []
    while rest:
        record = []
        for _ in range(number(b" fields\n")):
            length = number(b" bytes\n")
            record.append(bytes(rest[:length]))
            rest = rest[length:]
        records.append(record)
    return records


TEXTS = st.text(st.characters(), max_size=12) | st.sampled_from(
    ["", "2 bytes\nab", "3 fields\n", "program", "file", "a:b", "\ud800", "\n", "1"]
)
SOURCES = st.none() | st.builds(SourceFile, TEXTS, TEXTS)
CELLS = st.builds(Cell, st.integers(1, 12), TEXTS, st.lists(TEXTS, max_size=3).map(tuple))
SUBMISSIONS = st.builds(
    Submission,
    student=TEXTS,
    program=SOURCES,
    responder=SOURCES,
    files=st.dictionaries(TEXTS, st.binary(max_size=9) | TEXTS.map(lambda t: t.encode("utf-8", "replace")), max_size=3),
    notebook=st.none() | st.builds(Notebook, TEXTS, st.lists(CELLS, max_size=3).map(tuple)),
)


@given(SUBMISSIONS)
def test_all_of_a_submission_but_its_student_can_be_read_back_from_what_is_hashed(submission: Submission) -> None:
    program = responder = notebook = None
    cells: list[Cell] = []
    files = {}
    for kind, *fields in _read_back(b"".join(submission.iterate_hash_data())):
        texts = [field.decode("utf-8", "surrogatepass") if kind != b"file" else "" for field in fields]
        match kind:
            case b"program":
                program = SourceFile(*texts)
            case b"responder":
                responder = SourceFile(*texts)
            case b"notebook":
                notebook = Notebook(texts[0], ())
            case b"cell":
                cells.append(Cell(int(texts[0]), texts[1], tuple(texts[2:])))
            case b"file":
                files[fields[0].decode("utf-8", "surrogatepass")] = fields[1]
    notebook = Notebook(notebook.name, tuple(cells)) if notebook is not None else None
    assert Submission(submission.student, program, responder, files, notebook=notebook) == submission


@given(st.lists(SUBMISSIONS, min_size=2, max_size=4))
def test_two_have_one_hash_only_where_they_are_the_same(submissions: list[Submission]) -> None:
    different = {
        repr((each.program, each.responder, each.notebook, sorted(each.files.items()))) for each in submissions
    }
    assert len({each.sha256 for each in submissions}) == len(different)
