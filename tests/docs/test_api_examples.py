"""Every request in the API documentation matches a route, and the documented signature is the one that is sent."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from paths import ROOT
from service.operations.scopes import SCOPES
from service.webhook_sender import sign_body
from web import web_in

DOCUMENT = (ROOT / "docs" / "api.md").read_text()


def test_every_request_shown_is_described(tmp_path: Path) -> None:
    with web_in(tmp_path) as web:
        paths = web.app.openapi()["paths"]
    examples = [shlex.split(line) for line in re.findall(r"^\$ (curl .*)$", DOCUMENT, re.MULTILINE)]
    assert len(examples) > 10
    for words in examples:
        (url,) = (word for word in words if word.startswith("$ROBOMARK/"))
        path, _, query = url.replace("$ROBOMARK", "/api/v1").partition("?")
        sends = {"-d", "--data-binary", "-F"} & set(words)
        method = words[words.index("-X") + 1].lower() if "-X" in words else "post" if sends else "get"
        fitting = [
            operations[method]
            for template, operations in paths.items()
            if method in operations and re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", template), path)
        ]
        assert fitting, (method, path)
        known = {each["name"] for each in fitting[0]["parameters"]} if query else set()
        assert {part.partition("=")[0] for part in query.split("&") if part} <= known


def test_the_signature_is_checked_as_shown() -> None:
    (source,) = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
    names: dict[str, object] = {}
    exec(source, names)
    is_ours = names["is_ours"]
    assert callable(is_ours)
    assert is_ours("secret", sign_body("secret", 1762000000, b"{}"), b"{}")
    assert not is_ours("secret", sign_body("other", 1762000000, b"{}"), b"{}")


def test_every_scope_is_told() -> None:
    assert set(re.findall(r"^\| `([a-z-]+)` \|", DOCUMENT, re.MULTILINE)) == set(SCOPES)
