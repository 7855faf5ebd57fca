"""Our own processes parse file formats only with the bounded readers, or with a documented reason."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from paths import ROOT

_PARSERS = {
    "ast.literal_eval",
    "ast.parse",
    "bz2.decompress",
    "compile",
    "configparser.ConfigParser",
    "csv.DictReader",
    "csv.reader",
    "eval",
    "exec",
    "gzip.decompress",
    "gzip.open",
    "joblib.load",
    "json.JSONDecoder",
    "json.load",
    "json.loads",
    "lzma.decompress",
    "lzma.open",
    "marshal.loads",
    "numpy.load",
    "onnxruntime.InferenceSession",
    "pandas.read_csv",
    "pickle.Unpickler",
    "pickle.load",
    "pickle.loads",
    "plistlib.loads",
    "shutil.unpack_archive",
    "tarfile.TarFile",
    "tarfile.open",
    "tomllib.load",
    "tomllib.loads",
    "xml.etree.ElementTree.XML",
    "xml.etree.ElementTree.fromstring",
    "xml.etree.ElementTree.iterparse",
    "xml.etree.ElementTree.parse",
    "zipfile.is_zipfile",
    "zlib.decompress",
    "zlib.decompressobj",
}
_METHODS = {"model_validate_json", "validate_json"}
_MODULES = ("yaml.", "PIL.Image.open", "zipfile.ZipFile", "xml.dom", "xml.sax")
#: Runs inside the sandbox, where limits apply.
_INSIDE = (
    "responders/sandbox/inside/",
    "responders/kit/",
    "responders/library/",
    "responders/training_harness.py",
    "service/queue/known_answer/",
    "sim/brick/",
    "submissions/catalogue/",
    "submissions/template/",
)
_OURS = "a file of this package"
_STORED = "made by us from a grade, within the limits of grading"
_ALLOWED = {
    ("models/cards.py", "json.loads"): _OURS,
    ("models/networks.py", "onnxruntime.InferenceSession"): "packaged weights whose hash stands on their card",
    ("models/perceptrons.py", "joblib.load"): "packaged weights whose hash stands on their card",
    ("responders/sandbox/zygote.py", "json.loads"): "from a zygote, which runs no student's code",
    ("responders/wire.py", "json.JSONDecoder"): "lines of at most 64 kB, checked against a closed schema",
    ("service/operations/exports.py", "zipfile.ZipFile"): "is written",
    ("service/grading/judging/limited_judging.py", "pickle.loads"): "from a process of ours that was forked to judge",
    (
        "service/grading/judging/limited_judging.py",
        "pickle.Unpickler",
    ): "from a process of ours that was forked to judge",
    ("service/lti/keys.py", "json.loads"): "made by us from our own key",
    ("service/queue/self_test.py", "json.loads"): _OURS,
    ("service/reports/formats/moodle.py", "zipfile.ZipFile"): "is written",
    ("robomark/runs.py", "zlib.decompressobj"): "no more than it may become",
    ("service/statements/tick_columns.py", "zlib.decompressobj"): "no more than it may become",
    ("service/store/artifacts.py", "zlib.decompress"): _STORED,
    ("service/student_export.py", "zlib.decompress"): _STORED,
    ("service/store/batches/rankings.py", "zlib.decompress"): _STORED,
    ("service/store/courses/assignment_versions.py", "json.loads"): "an assignment that was read within its limits",
    (
        "service/store/courses/assignment_versions.py",
        "zlib.decompress",
    ): "an assignment that was read within its limits",
    ("service/store/grades/causes.py", "json.loads"): _STORED,
    ("service/store/grades/judged_again.py", "json.loads"): _STORED,
    ("service/store/grades/recording_texts.py", "json.loads"): _STORED,
    ("service/store/grades/recording_texts.py", "zipfile.ZipFile"): _STORED,
    ("service/store/grades/recording_texts.py", "zlib.decompress"): _STORED,
    ("service/store/grades/recordings.py", "json.loads"): _STORED,
    ("service/store/grades/recordings.py", "numpy.load"): _STORED,
    ("service/store/grades/recordings.py", "zlib.decompress"): _STORED,
    ("service/student_export.py", "zipfile.ZipFile"): "is written",
    ("service/web/api/notebook_runs.py", "zlib.decompress"): _STORED,
    ("service/web/api/test_runs.py", "zlib.decompress"): _STORED,
    ("sim/floors/digits.py", "numpy.load"): _OURS,
    ("sim/floors/tracks.py", "json.loads"): _OURS,
    ("sim/world.py", "eval"): "a text in our own source",
    ("submissions/assignment/assignment_parts.py", "json.loads"): _OURS,
    ("submissions/assignment/export.py", "zipfile.ZipFile"): "is written",
    ("submissions/assignment/table_problems.py", "model_validate_json"): "made by us of what the TOML reader has read",
    ("submissions/student_names.py", "json.loads"): _OURS,
    ("submissions/stored_submission.py", "zipfile.ZipFile"): "is written",
}


def parser_calls(source: str) -> Iterator[str]:
    """Yield the parsers in the source by their full names. A call through an alias is included."""
    tree = ast.parse(source)
    known: dict[str, str] = {name: name for name in ("compile", "eval", "exec")}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for each in node.names:
                top = each.name.partition(".")[0]
                known[each.asname or top] = each.name if each.asname else top
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for each in node.names:
                known[each.asname or each.name] = f"{node.module}.{each.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute | ast.Name) and isinstance(node.ctx, ast.Load):
            name = _full_name(node, known)
            if name in _PARSERS or (name.startswith(_MODULES) and not name.endswith(("Error", "Event"))):
                yield name
            elif isinstance(node, ast.Attribute) and node.attr in _METHODS:
                yield node.attr


def _full_name(node: ast.expr, known: dict[str, str]) -> str:
    if isinstance(node, ast.Attribute):
        return f"{_full_name(node.value, known)}.{node.attr}"
    return known.get(node.id, "") if isinstance(node, ast.Name) else ""


def _product_files() -> Iterator[tuple[str, Path]]:
    for package in ("models", "responders", "robomark", "service", "sim", "submissions"):
        for path in sorted((ROOT / package).rglob("*.py")):
            name = path.relative_to(ROOT).as_posix()
            if not name.startswith((*_INSIDE, "sim/readers/")):
                yield name, path


def test_every_format_is_read_by_its_reader() -> None:
    document = {(name, call) for name, path in _product_files() for call in parser_calls(path.read_text("utf-8"))}
    assert document - _ALLOWED.keys() == set(), "read it with a module of sim.readers"
    assert _ALLOWED.keys() - document == set(), "these are read by their readers now: strike them from the list"


@pytest.mark.parametrize(
    ("source", "calls"),
    [
        ("import json\njson.loads(x)", ["json.loads"]),
        ("from json import loads as read\nread(x)", ["json.loads"]),
        ("import numpy as np\nnp.load(x)", ["numpy.load"]),
        ("from PIL import Image\nImage.open(x)", ["PIL.Image.open"]),
        ("import functools, tomllib\nfunctools.partial(tomllib.loads)", ["tomllib.loads"]),
        ("import xml.etree.ElementTree as tree\ntree.fromstring(x)", ["xml.etree.ElementTree.fromstring"]),
        ("import re\nre.compile('a')", []),
        ("compile('a', '', 'exec')", ["compile"]),
        ("import zipfile\nzipfile.ZipFile(x)\nzipfile.ZipInfo(y)", ["zipfile.ZipFile"]),
    ],
)
def test_a_direct_call_is_found(source: str, calls: list[str]) -> None:
    assert list(parser_calls(source)) == calls
