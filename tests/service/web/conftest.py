"""A separate web application for each test, and an instructor's browser for it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from web import Web, web_in


@pytest.fixture
def web(tmp_path: Path) -> Iterator[Web]:
    with web_in(tmp_path) as made:
        yield made


@pytest.fixture
def grace(web: Web) -> TestClient:
    return web.browser(web.instructor())
