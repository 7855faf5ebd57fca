"""Builds notebooks from the sources of their cells, for tests."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from paths import DATA

NOTEBOOKS = DATA / "notebooks"
#: The course's notebook on messaging with its magics, and its conversion by nbconvert.
MESSAGING = NOTEBOOKS / "messaging.ipynb"
MESSAGING_SCRIPT = NOTEBOOKS / "messaging.nbconvert.txt"


def document(cells: Sequence[str], tags: Mapping[int, Sequence[str]] | None = None) -> dict[str, Any]:
    """Return the JSON of a notebook; ``tags`` by the number of the cell, from 1."""
    return {
        "cells": [
            {
                "cell_type": "code",
                "execution_count": None,
                "metadata": {"tags": list((tags or {}).get(number, ()))},
                "outputs": [],
                "source": source.splitlines(keepends=True),
            }
            for number, source in enumerate(cells, 1)
        ],
        "metadata": {},
        "nbformat": 4,
        "nbformat_minor": 4,
    }


def notebook(path: Path, cells: Sequence[str], tags: Mapping[int, Sequence[str]] | None = None) -> Path:
    """Write a notebook to disk."""
    path.write_text(json.dumps(document(cells, tags)))
    return path
