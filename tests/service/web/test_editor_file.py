"""The built editor belongs to its sources, names its licences and loads nothing."""

from __future__ import annotations

import hashlib
import json
import re

import pytest

from paths import ROOT

pytestmark = pytest.mark.fast

SOURCES = ROOT / "service" / "web" / "editor"
BUILT = (ROOT / "service" / "web" / "static" / "editor.min.js").read_text("utf-8")


def test_it_is_built_from_the_sources() -> None:
    names = ("build.mjs", "editor.js", "package-lock.json", "page.js")
    digest = hashlib.sha256(b"".join((SOURCES / name).read_bytes() for name in names)).hexdigest()
    assert BUILT.startswith(f"/* sources: {digest}\n"), "run make editor"


def test_every_package_in_it_has_its_licence() -> None:
    packages = json.loads((SOURCES / "package-lock.json").read_text())["packages"]
    notice = BUILT.partition("*/")[0]
    assert {package["license"] for package in packages.values()} == {"MIT"}
    for name in json.loads((SOURCES / "package.json").read_text())["devDependencies"].keys() - {"esbuild"}:
        assert name in notice, name
    assert "Permission is hereby granted" in notice


def test_neither_names_an_address_to_load_from() -> None:
    assert "resolved" not in (SOURCES / "package-lock.json").read_text()
    code = BUILT.partition("*/")[2]
    assert set(re.findall(r"https?://[\w./-]+", code)) <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xhtml"}
