"""Interfaces leave transactions to operations. import-linter prevents them from importing the store."""

from __future__ import annotations

import ast
from pathlib import Path

from paths import ROOT


def _calls(file: Path) -> set[str]:
    nodes = ast.walk(ast.parse(file.read_text()))
    return {node.func.attr for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)}


def test_no_interface_opens_a_transaction() -> None:
    rooms = [ROOT / "service" / room for room in ("web", "commands")]
    called = {file: _calls(file) for room in rooms for file in room.rglob("*.py")}
    assert [file for file, names in called.items() if names & {"transaction", "reading", "begin_nested"}] == []
