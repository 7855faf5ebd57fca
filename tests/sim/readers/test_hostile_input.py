"""Small files with large demands: each reader refuses them before the format's own parser builds objects.

The tests count the work (calls, lines, bytes), and a child process with little memory reads files of the maximum size.
"""

from __future__ import annotations

import contextlib
import io
import json
import struct
import subprocess
import sys
import tomllib
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, overload

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sim.readers.csv_text import MAX_LINES_OF_RECORD, read_records, read_rows
from sim.readers.json_text import read_json
from sim.readers.python_source import parse_module
from sim.readers.raster_image import read_image
from sim.readers.reader_errors import MAX_DEPTH, UnreadableDataError
from sim.readers.toml_text import read_toml
from sim.readers.yaml_text import read_yaml
from sim.readers.zip_archive import open_zip, read_entry_chunks


def _zip_of(entries: int, data: bytes = b"") -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for number in range(entries):
            archive.writestr(str(number), data)
    return buffer.getvalue()


def _open(data: bytes) -> None:
    with open_zip(io.BytesIO(data), 100):
        pass


def _jpeg_of_many_scans() -> bytes:
    buffer = io.BytesIO()
    Image.new("L", (64, 64)).save(buffer, "JPEG", progressive=True)
    data = buffer.getvalue()
    at = data.rindex(b"\xff\xda")
    return data[:at] + data[at:-2] * 100 + data[-2:]


def _png_that_claims(width: int, height: int) -> bytes:
    buffer = io.BytesIO()
    Image.new("L", (1, 1)).save(buffer, "PNG")
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = buffer.getvalue()
    return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]


#: Refused files, and the parser that must not be called.
_REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "toml, dotted key": (lambda: read_toml("a" + ".a" * 16_000 + " = 1"), "tomllib.loads"),
    "toml, dotted key with blanks": (lambda: read_toml("a" + " . a" * 20 + " = 1"), "tomllib.loads"),
    "toml, dotted key in quotes": (lambda: read_toml("'a'" + '."a"' * 20 + " = 1"), "tomllib.loads"),
    "toml, dotted header": (lambda: read_toml("[a" + ".a" * 20 + "]"), "tomllib.loads"),
    "toml, dotted header of an array": (lambda: read_toml("[[a" + ".a" * 20 + "]]"), "tomllib.loads"),
    "toml, dotted key in a table in a line": (lambda: read_toml("x = {a" + ".a" * 20 + " = 1}"), "tomllib.loads"),
    "toml, dotted key after texts": (
        lambda: read_toml("x = '''it's \"''''\ny = \"#\\\"\" # '\na" + ".a" * 20 + " = 1"),
        "tomllib.loads",
    ),
    "toml, deep lists": (lambda: read_toml("a = " + "[" * 50_000), "tomllib.loads"),
    "toml, deep tables": (lambda: read_toml("a = " + "{a = " * 50_000), "tomllib.loads"),
    "toml, many keys": (lambda: read_toml("".join(f"k{n} = 1\n" for n in range(30_000))), "tomllib.loads"),
    "toml, many parts": (
        lambda: read_toml("".join(f"k{n}.b.c.d.e.f.g.h = 1\n" for n in range(4_000))),
        "tomllib.loads",
    ),
    "toml, many tables": (lambda: read_toml("[[a]]\n" * 20_000), "tomllib.loads"),
    "toml, many values": (lambda: read_toml("a = [" + "1," * 300_000 + "]"), "tomllib.loads"),
    "json, deep": (lambda: read_json("[" * 100_000), "json.loads"),
    "json, deep and closed": (lambda: read_json("[" * 200 + "]" * 200), "json.loads"),
    "json, deep in both ways": (lambda: read_json('[{"a":' * 100 + "1" + "}]" * 100), "json.loads"),
    "json, many lists": (lambda: read_json("[" + "[]," * 300_000 + "0]"), "json.loads"),
    "json, many numbers": (lambda: read_json(b"[" + b"1," * 300_000 + b"0]"), "json.loads"),
    "csv, many cells": (lambda: read_rows("," * 3_000_000), "csv.reader"),
    "csv, many rows": (lambda: list(read_records(["\n"] * 3_000_000, ",")), "csv.reader"),
    "yaml, deep": (lambda: read_yaml(b"[" * 5_000), "yaml.load"),
    "yaml, many values": (lambda: read_yaml(b"- a\n" * 600_000), "yaml.load"),
    "yaml, long": (lambda: read_yaml(b" " * 30_000_000), "yaml.load"),
    "zip, many entries": (partial(_open, _zip_of(101)), "zipfile.ZipFile.__init__"),
    "zip, a stored zip in it": (partial(_open, _zip_of(1, _zip_of(101))), "zipfile.ZipFile.__init__"),
    "python, many tokens": (lambda: parse_module("0;" * 300_000), "ast.parse"),
    "python, dotted import": (lambda: parse_module("import a" + ".a" * 20_000), "ast.parse"),
    "python, dotted import with blanks": (
        lambda: parse_module("from a" + " .\\\n\u0061\u0301" * 200 + " import b"),
        "ast.parse",
    ),
    "python, long f-string": (lambda: parse_module("f'" + "{a}" * 60_000 + "'"), "ast.parse"),
    "image, many scans": (partial(read_image, _jpeg_of_many_scans(), 64, 64), "PIL.Image.Image.convert"),
    "image, another size": (
        lambda: read_image(_png_that_claims(60_000, 60_000), 64, 64),
        "PIL.Image.Image.convert",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("case", _REFUSED)
def test_it_is_refused_before_it_is_parsed(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    read, parser = _REFUSED[case]

    def never(*_arguments: object, **_named: object) -> None:
        pytest.fail(f"{parser} was called")

    monkeypatch.setattr(parser, never)
    with pytest.raises(UnreadableDataError):
        read()


@pytest.mark.parametrize(
    ("read", "most"),
    [
        (lambda: read_toml("a" + ".a" * 16_000 + " = 1"), 2_000_000),
        (lambda: read_json("[" + "[]," * 300_000 + "0]"), 8_000_000),
        (lambda: read_toml("a = 1" + "0" * 500_000), 80_000_000),
    ],
)
def test_a_refusal_takes_little_memory(read: Callable[[], object], most: int) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(UnreadableDataError):
            read()
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()


_AT_THE_LIMIT = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
resource.setrlimit(resource.RLIMIT_CPU, (60, 60))
from sim.readers.csv_text import read_rows
from sim.readers.json_text import read_json
from sim.readers.python_source import parse_module
from sim.readers.toml_text import read_toml
from sim.readers.yaml_text import read_yaml
read_toml("".join(f"k{n}.b = 1\\n" for n in range(19_000)))
read_toml("".join(f"[k{n}.b]\\n" for n in range(19_000)))
read_toml("".join(f"k{n}.b.c.d.e.f.g.h.i.j = 1\\n" for n in range(1_900)))
read_toml("a = [" + "1," * 199_000 + "]")
read_toml("a = " + "[" * 90 + "]" * 90)
read_json("[" + "[]," * 99_000 + "0]")
read_json("[" * 100 + "]" * 100)
read_rows("," * 1_990_000)
read_yaml(b"- a\\n" * 490_000)
parse_module("0;" * 99_000)
print("all read")
"""


@pytest.mark.long
def test_what_is_allowed_is_read_in_little_memory() -> None:
    done = subprocess.run([sys.executable, "-c", _AT_THE_LIMIT], capture_output=True, text=True, check=False)
    assert done.stdout == "all read\n", done.stderr[-2000:]


_QUOTES = ('\\"', '"\\\\"', "'", '"""', "'''", '"x', '"\n', "'\n", '["', '{"a', "#'")


@pytest.mark.long
@pytest.mark.parametrize("quotes", _QUOTES)
@pytest.mark.parametrize("before", ["", "[[" * 60, 'a = """'])
@pytest.mark.parametrize("read", [read_json, read_toml, parse_module, read_rows, lambda text: read_yaml(text.encode())])
def test_texts_without_an_end_are_read_once(read: Callable[[str], object], before: str, quotes: str) -> None:
    """A reader that searched for the end of each text again would take many minutes."""
    text = before + quotes * (300_000 // len(quotes))
    with contextlib.suppress(ValueError, SyntaxError):
        read(text)


@pytest.mark.parametrize("number", ["0x" + "f" * 20_000, "9" * 5_000, "0b" + "1" * 70, "[1, [18446744073709551616]]"])
def test_numbers_that_are_too_long_are_refused(number: str) -> None:
    with pytest.raises(UnreadableDataError, match="number that is too long"):
        read_toml(f"a = {number}")


def test_a_json_number_that_is_too_long_is_refused() -> None:
    with pytest.raises(UnreadableDataError, match="number that is too long"):
        read_json(f"[{'9' * 5_000}]")


class _CountedLines(Sequence[str]):
    """Lines, with a count of the accesses."""

    def __init__(self, lines: Sequence[str]) -> None:
        self._lines = lines
        self.taken = 0

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[str]: ...

    def __getitem__(self, place: int | slice) -> str | Sequence[str]:
        self.taken += 1
        return self._lines[place]

    def __iter__(self) -> Iterator[str]:
        return iter(self._lines)

    def __len__(self) -> int:
        return len(self._lines)


@pytest.mark.parametrize("line", ['a",b,"\n', '"a\n', '"a" b\n', '"\n', '"",",\n'])
def test_broken_quotes_cost_the_same_for_each_row(line: str) -> None:
    for count in (500, 4_000):
        lines = _CountedLines(["id,name\n", *[line] * count])
        list(read_records(lines, ","))
        assert lines.taken <= (MAX_LINES_OF_RECORD + 1) * (count + 1)


def test_a_row_with_broken_quotes_costs_itself_alone() -> None:
    records = list(read_records(["id,name\n", 'ada,"Ada\n', "bob,Bob\n"], ","))
    assert [(each.line, each.broken) for each in records] == [(1, False), (2, True), (3, False)]


def test_a_row_of_several_lines_is_one_row() -> None:
    (records,) = read_records(['ada,"one\n', "two\n", 'three"\n'], ",")
    assert list(records.cells) == ["ada", "one\ntwo\nthree"]


_NAMES = st.text("abc-_1", min_size=1, max_size=4)
_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.one_of(st.integers(-(2**60), 2**60), st.booleans(), st.text(max_size=8), st.floats(allow_nan=False)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(_NAMES, inner, max_size=4)),
    max_leaves=12,
)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {_toml(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value).replace("\x7f", "\\u007f").replace("Infinity", "inf")


@given(st.dictionaries(_NAMES, _VALUES, max_size=5))
def test_ordinary_values_are_read_as_their_own_parsers_read_them(value: dict[str, Any]) -> None:
    text = json.dumps(value)
    assert read_json(text) == read_json(text.encode()) == json.loads(text)
    document = "".join(f"{json.dumps(key)} = {_toml(each)}\n" for key, each in value.items())
    try:
        expected = tomllib.loads(document)
    except tomllib.TOMLDecodeError:  # lone surrogates
        return
    assert read_toml(document) == expected


@given(st.text(alphabet="\"'#[]{}=.,\\\n a1", max_size=60))
def test_no_text_is_read_that_the_parser_refuses_or_refused_that_it_reads(text: str) -> None:
    for read, parse in ((read_toml, tomllib.loads), (read_json, json.loads)):
        try:
            expected = parse(text)
        except ValueError:
            with pytest.raises((UnreadableDataError, tomllib.TOMLDecodeError, json.JSONDecodeError)):
                read(text)
        else:
            assert read(text) == expected


@given(st.integers(0, 3 * MAX_DEPTH))
def test_json_is_read_to_one_depth_and_no_deeper(depth: int) -> None:
    text = "[" * depth + "0" + "]" * depth
    if depth <= MAX_DEPTH:
        read_json(text)
    else:
        with pytest.raises(UnreadableDataError):
            read_json(text)


@pytest.mark.parametrize(
    "text", ["-" * 100_000 + "1", "x" + ".y" * 60_000, "(" * 5_000, "x = " + "+".join("1" * 90_000)]
)
def test_deep_python_is_refused_and_never_ends_the_process(text: str) -> None:
    with pytest.raises((UnreadableDataError, SyntaxError)):
        parse_module(text)


def test_an_entry_that_is_compressed_by_other_means_is_not_read() -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("a", b"0" * 1000)
    with open_zip(buffer, 10) as opened, pytest.raises(UnreadableDataError):
        list(read_entry_chunks(opened, opened.infolist()[0]))


def test_yaml_without_sense_is_refused_with_its_line() -> None:
    with pytest.raises(UnreadableDataError, match="line 2"):
        read_yaml(b"a: 1\n]b\n")
    assert read_yaml(b"a: 1") == {"a": "1"}
