"""Archives with false sizes and notebook bombs: each is read within the limits, or refused with a short message.

``test_bundle.py`` covers ordinary broken and forbidden archives.
"""

from __future__ import annotations

import io
import json
import resource
import struct
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.errors import UsageError
from submissions import archive_extraction
from submissions.bundle import read_submission
from submissions.raw_files import MAX_FILE_BYTES, MAX_TOTAL_BYTES, read_zip_bytes

_PLAIN = {"robot.py": b"print(1)\n", "responder.py": b"def responder(text): return text\n"}


def _archive(files: Mapping[str, bytes] | Sequence[tuple[str, bytes]] = _PLAIN) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in files.items() if isinstance(files, Mapping) else files:
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _directory(data: bytes) -> int:
    return data.index(b"PK\x01\x02")


def _patched(data: bytes, at: int, form: str, value: int) -> bytes:
    return data[:at] + struct.pack(form, value) + data[at + struct.calcsize(form) :]


def _says_it_is_smaller() -> bytes:
    """Both headers claim ten bytes for a megabyte of data."""
    data = _archive({"robot.py": b"#" * (1 << 20)})
    data = _patched(data, 22, "<I", 10)
    return _patched(data, _directory(data) + 24, "<I", 10)


def _says_it_is_enormous() -> bytes:
    data = _archive()
    return _patched(data, _directory(data) + 24, "<I", 0xFFFFFFFE)


def _sizes_in_a_field_that_is_not_there() -> bytes:
    """All bits set refer to the zip64 field, which is missing."""
    data = _archive()
    return _patched(data, _directory(data) + 24, "<I", 0xFFFFFFFF)


def _a_zip64_directory_far_away() -> bytes:
    data = _archive()
    end = data.index(b"PK\x05\x06")
    far = struct.pack("<4sQ2H2L4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, 1 << 40, 1 << 40, 1 << 50, 1 << 60)
    locator = struct.pack("<4sLQL", b"PK\x06\x07", 0, end, 1)
    return data[:end] + far + locator + data[end:]


def _entries_that_share_their_bytes() -> bytes:
    """One megabyte of zeros, listed two hundred times."""
    data = _archive({"aaaa.txt": bytes(MAX_TOTAL_BYTES // 100)})
    at = _directory(data)
    end = data.index(b"PK\x05\x06")
    entry = data[at:end]
    entries = b"".join(entry.replace(b"aaaa.txt", b"%04d.txt" % number) for number in range(200))
    tail = bytearray(data[end:])
    struct.pack_into("<HHI", tail, 8, 200, 200, len(entries))
    local = data[:at].replace(b"aaaa.txt", b"0000.txt")
    return local + entries + bytes(tail)


def _a_directory_of_more_than_there_is() -> bytes:
    data = _archive()
    return _patched(data, data.index(b"PK\x05\x06") + 8, "<H", 0xFFFF)


def _a_directory_before_the_file() -> bytes:
    data = _archive()
    return _patched(data, data.index(b"PK\x05\x06") + 16, "<I", 0xFFFFFFF0)


def _behind_something_else() -> bytes:
    return b"MZ" + bytes(5000) + _archive()


def _another_name_in_the_extra_field() -> bytes:
    """The Unicode path field, which other tools prefer."""
    info = zipfile.ZipInfo("robot.py")
    extra = b"\x01" + struct.pack("<I", 0) + b"../../evil.py"
    info.extra = struct.pack("<HH", 0x7075, len(extra)) + extra
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(info, b"print(1)")
    return buffer.getvalue()


def _a_very_deep_path() -> bytes:
    return _archive({"a/" * 10_000 + "robot.py": b""})


def _a_name_in_no_encoding() -> bytes:
    data = _archive({"robot.py": b"", "xx.txt": b""})
    return data.replace(b"xx.txt", b"\xff\xfe.txt")


_LIES: list[Callable[[], bytes]] = [
    _says_it_is_smaller,
    _says_it_is_enormous,
    _sizes_in_a_field_that_is_not_there,
    _a_zip64_directory_far_away,
    _entries_that_share_their_bytes,
    _a_directory_of_more_than_there_is,
    _a_directory_before_the_file,
    _behind_something_else,
    _another_name_in_the_extra_field,
    _a_very_deep_path,
    _a_name_in_no_encoding,
]


@pytest.mark.parametrize("lie", _LIES, ids=lambda lie: lie.__name__)
def test_an_archive_that_lies_is_read_within_the_caps_or_refused(lie: Callable[[], bytes]) -> None:
    data = lie()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    files, refusal = _unzipped(data)
    assert (files is None) == refusal.startswith("x.zip: ")
    assert "\n" not in refusal
    if files is not None:
        assert sum(map(len, files.values())) <= MAX_TOTAL_BYTES
        assert max(map(len, files.values())) <= MAX_FILE_BYTES
        assert not any("/" in name or "\\" in name or name in (".", "..") for name in files)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 3 * MAX_TOTAL_BYTES // 1024


def _notebook(*cells: object) -> bytes:
    return json.dumps({"nbformat": 4, "nbformat_minor": 2, "metadata": {}, "cells": list(cells)}).encode()


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(b"[" * 200_000, id="nested"),
        pytest.param(b'{"cells":' + b'{"a":' * 100_000, id="nested-objects"),
        pytest.param(b'{"nbformat":' + b"9" * 100_000 + b',"cells":[]}', id="digits"),
        pytest.param(b'{"nbformat":1e999,"cells":[]}', id="infinite"),
        pytest.param(b'{"nbformat":4,"nbformat":4,"cells":[],"cells":[1]}', id="twice"),
        pytest.param(_notebook(None, 5, "x", [], {}), id="cells-that-are-none"),
        pytest.param(_notebook({"cell_type": "code", "source": 5}), id="source-that-is-none"),
        pytest.param(_notebook({"cell_type": "code", "source": [["print(1)"]]}), id="lines-of-lines"),
        pytest.param(rb'{"nbformat":4,"cells":[{"cell_type":"code","source":"\ud800"}]}', id="surrogate"),
        pytest.param(b"\xff\xfe" + '{"cells":[]}'.encode("utf-16-le"), id="utf-16"),
        pytest.param(b'{"cells":[\xff]}', id="no-encoding"),
        pytest.param(_notebook(*[{"cell_type": "code", "source": "x"}] * 50_000), id="many-cells"),
    ],
)
def test_a_notebook_that_is_a_bomb_is_read_or_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "x.ipynb"
    path.write_bytes(data)
    refusal = "x.ipynb: read"
    try:
        read_submission(path)
    except UsageError as error:
        refusal = str(error)
    assert refusal.startswith("x.ipynb: ")
    assert "\n" not in refusal


_NAMES = st.sampled_from(["robot.py", "a/robot.py", "../x", "x.ipynb", "submission.toml", "C:/x", "a\\b"])


@given(
    st.lists(st.tuples(_NAMES | st.text(max_size=8), st.binary(max_size=80)), min_size=1, max_size=4),
    st.lists(st.tuples(st.integers(0, 1 << 16), st.binary(min_size=1, max_size=8)), max_size=4),
)
def test_no_archive_of_any_making_raises_anything_else(
    files: list[tuple[str, bytes]], damage: list[tuple[int, bytes]]
) -> None:
    try:
        data = bytearray(_archive(files))
    except (UnicodeEncodeError, ValueError, UserWarning):
        # Python cannot write every archive, for example one with two files of the same name.
        return
    for place, new in damage:
        at = place % len(data)
        data[at : at + len(new)] = new
    unzipped_files, refusal = _unzipped(bytes(data))
    assert (unzipped_files is None) == refusal.startswith("x.zip: ")


def _unzipped(data: bytes) -> tuple[dict[str, bytes] | None, str]:
    """Return the files, or the reason for the refusal."""
    try:
        return read_zip_bytes(data, "x.zip").files, ""
    except UsageError as error:
        return None, str(error)


@pytest.mark.parametrize("depth", [900, 1500])
def test_a_file_in_very_many_folders_is_refused(depth: int, tmp_path: Path) -> None:
    """A few kilobytes of folder names would take seconds to create, or end in an error of Python."""
    archive, folder = tmp_path / "class.zip", tmp_path / "class"
    folder.mkdir()
    with zipfile.ZipFile(archive, "w") as written:
        written.writestr("ada/robot.py", "print(1)")
        written.writestr("/".join(["d"] * depth) + "/robot.py", "print(1)")
    with pytest.raises(UsageError, match="in more than 20 folders"):
        archive_extraction.unzip(archive, folder, 100, 10**6)
    assert not (folder / "d").exists()
