"""Every accepted submission is read back unchanged. One that could not be read back is refused at once."""

from __future__ import annotations

import json
import tempfile
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.errors import UsageError
from submissions.bundle import build_submission, read_submission
from submissions.notebook import pack_notebook, read_notebook
from submissions.raw_files import (
    MAX_FILE_BYTES,
    MAX_FILES,
    MAX_TOTAL_BYTES,
    UploadedFile,
    read_uploaded,
    read_zip_bytes,
)
from submissions.stored_submission import pack_submission, unpack_submission
from submissions.submission import Submission

PARTS = {"robot.py": b"print('hello')\n", "responder.py": b"def responder(msg):\n    return msg\n"}


def _of_folder(files: Mapping[str, bytes]) -> Submission:
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) / "ada"
        own.mkdir()
        for name, data in files.items():
            (own / name).write_bytes(data)
        return read_submission(own)


def _of_zip(files: Mapping[str, bytes]) -> Submission:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return build_submission(read_zip_bytes(buffer.getvalue(), "ada.zip"), "ada.zip", "ada", "")


def _sent(files: Mapping[str, bytes]) -> Submission:
    raw = read_uploaded([UploadedFile(name, BytesIO(data)) for name, data in files.items()], "what was sent")
    return build_submission(raw, "what was sent", "ada", "")


WAYS = {"folder": _of_folder, "zip": _of_zip, "sent": _sent}


def _filled(total: int) -> dict[str, bytes]:
    """Return the parts and extra files, of ``total`` bytes together."""
    files, left = dict(PARTS), total - sum(map(len, PARTS.values()))
    while left:
        files[f"data-{len(files)}.bin"] = bytes(min(left, MAX_FILE_BYTES))
        left -= len(files[f"data-{len(files) - 1}.bin"])
    return files


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "files",
    [
        {**PARTS, **{f"{number}.txt": b"x" for number in range(MAX_FILES - len(PARTS))}},
        _filled(MAX_TOTAL_BYTES),
        {**PARTS, "notes.toml": b"x", "caf\u00e9 \U0001f916.txt": b"x", "-rf": b"", "a" * 200: b"x", " ": b"blank"},
    ],
    ids=["as many files as may be", "as large as may be", "unusual names"],
)
def test_the_most_that_is_accepted_is_read_back(way: str, files: dict[str, bytes]) -> None:
    submission = WAYS[way](files)
    again = unpack_submission(pack_submission(submission))
    assert again == submission
    assert again.sha256 == submission.sha256


@pytest.mark.parametrize("name", ["old\\notes.txt", "a:b.txt"])
def test_names_that_cannot_be_kept_are_refused_with_what_to_do(name: str) -> None:
    with pytest.raises(UsageError, match=r"backslash or a colon in it .*rename the file"):
        _of_folder({**PARTS, name: b"x"})


def test_a_character_that_a_notebook_splits_is_read_back() -> None:
    lines = ["%%sim_magic_preloaded\n", "print('\ud83e", "\udd16')"]
    cells: list[dict[str, object]] = [
        {"cell_type": "code", "source": source, "metadata": {}} for source in (lines, "".join(lines))
    ]
    split, whole = (read_notebook(json.dumps({"cells": [cell]}).encode(), "a.ipynb").notebook for cell in cells)
    assert split == whole
    assert read_notebook(pack_notebook(split), "a.ipynb").notebook == split


def test_many_notes_are_read_back(tmp_path: Path) -> None:
    """A folder can have thousands of links, with a note for each."""
    for name, data in PARTS.items():
        (tmp_path / name).write_bytes(data)
    for number in range(2000):
        (tmp_path / f"{'link' * 10}-{number}").symlink_to(tmp_path / "robot.py")
    submission = read_submission(tmp_path, student="ada")
    assert unpack_submission(pack_submission(submission)) == submission


_NAMES = st.one_of(
    st.sampled_from(
        [
            "robot.py",
            "responder.py",
            "notebook.ipynb",
            "submission.toml",
            "a.py",
            "ROBOT.PY",
            "C:a",
            "a:b",
            "a\\b",
            "a.zip",
        ]
    ),
    st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), min_size=1, max_size=12),
)
_CONTENTS = st.one_of(
    st.sampled_from([*PARTS.values(), b"", b'{"cells": []}', b'run = "x"\n', b'notes = ["\\u007f"]\n', b"PK\x05\x06"]),
    st.binary(max_size=40),
)


@given(st.dictionaries(_NAMES, _CONTENTS, max_size=6), st.booleans(), st.sampled_from(sorted(WAYS)))
@settings(max_examples=150)
def test_whatever_intake_accepts_is_read_back(files: dict[str, bytes], with_parts: bool, way: str) -> None:
    if with_parts:
        files = {**files, **PARTS}
    try:
        submission = WAYS[way](files)
    except (UsageError, OSError):
        return
    again = unpack_submission(pack_submission(submission))
    assert again == submission
    assert again.sha256 == submission.sha256
