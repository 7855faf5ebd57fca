"""Runs one operation by page, API and command, each on the same database, and compares the effects.

A row of the table in ``operation_table/`` is an operation with a request for each interface.
"""

from __future__ import annotations

import io
import re
import shlex
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient
from typer.exceptions import TyperException

from acting import Notices
from service.command_line import load_command
from service.commands import installation
from service.store.ids import ALPHABET, LENGTH
from service.web.rate_limits import RateLimits
from sim.errors import RobomarkError
from web import Web, csrf, web_in

Prepare = Callable[[Web], dict[str, str]]

INTERFACES = ("page", "api", "command")
#: Columns left out of the comparison: the actor, secrets, and the size of compressed data that contains times.
_UNEQUAL = frozenset({"actor", "published_by", "sha256", "secret", "size"})
#: Columns of signed statements, which have random keys and salts.
_SIGNED = frozenset({"leaf_sha256", "salt", "opening_key", "key_id", "signature", "payload"})
_TIME = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d(\.\d+)?(\+00:00)?")
_ID = re.compile(rf"(?<![A-Za-z0-9])[{ALPHABET}]{{{LENGTH}}}(?![A-Za-z0-9])")


@dataclass(frozen=True, slots=True)
class Row:
    """One request by each interface that has the operation.

    ``page`` is a path and a form (a query, if the row has ``says``), ``api`` a method, a path and a body, ``command`` a
    line. ``{names}`` in them come from the ``state`` before the request. ``alone`` gives the reason for a missing
    interface. ``refused`` is the HTTP status and a sentence that each interface reports. The sentence is empty if an
    interface rejects the value while parsing, with its own message.
    """

    operation: Callable[..., object]
    page: tuple[str, Mapping[str, Any]] | None = None
    api: tuple[str, str, Any] | None = None
    command: str = ""
    alone: str = ""
    who: str = "grace"
    state: str = "course"
    refused: tuple[int, str] | None = None
    files: Mapping[str, str | bytes] = field(default_factory=dict)
    then: str = ""  # target of a second form, on the page of the answer
    says: tuple[str, ...] = ()  # read-only operations: texts in every answer

    @property
    def interfaces(self) -> tuple[str, ...]:
        """Return the interfaces that have the operation."""
        return tuple(each for each in INTERFACES if getattr(self, each))


@dataclass(frozen=True, slots=True)
class Left:
    """The effects of an operation by one interface, without times, new ids, secrets and the actor."""

    accepted: bool
    rows: tuple[str, ...]
    notices: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer of an interface: the HTTP status (commands: 0 or 2) and the text."""

    status: int
    text: str

    @property
    def is_accepted(self) -> bool:
        """Return whether the operation was carried out."""
        return self.status in (0, 200, 201, 204, 303)


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A database in the state before a request, with the names of its objects and its rows."""

    data: bytes
    values: Mapping[str, str]
    rows: Mapping[str, frozenset[tuple[Any, ...]]]
    columns: Mapping[str, list[str]]
    ids: frozenset[str]


@dataclass(frozen=True, slots=True)
class Installation:
    """A web server with its home, and the databases that it uses."""

    web: Web
    notices: Notices
    browsers: Mapping[str, tuple[TestClient, str]]
    program: TestClient
    tokens: Mapping[str, Mapping[str, str]]
    prepares: Mapping[str, Prepare]
    snapshots: dict[str, Snapshot]

    def run(self, row: Row, interface: str) -> tuple[Answer, Left]:
        """Carry out a row by one interface, from its state."""
        snapshot = self._restored(row.state)
        self.notices.sent.clear()
        self.web.app.state.context = replace(self.web.app.state.context, limits=RateLimits())
        answer: Answer = getattr(self, f"_by_{interface}")(row, snapshot.values)
        notices = tuple(each for each in self.notices.sent if each[1])
        return answer, Left(answer.is_accepted, self._changed(snapshot), notices)

    def _by_page(self, row: Row, values: Mapping[str, str]) -> Answer:
        assert row.page is not None
        browser, word = self.browsers[row.who]
        path, form = _filled(row.page, values)
        if row.says:
            answer = browser.get(_build_address("", path), params=form)
        else:
            answer = browser.post(_build_address("", path), data=form | {"csrf": word}, files=_parts(row.files) or None)
        if row.then and answer.status_code == 303:
            answer = browser.post(f"{answer.headers['location']}{row.then}", data={"csrf": word})
        return Answer(answer.status_code, answer.text)

    def _by_api(self, row: Row, values: Mapping[str, str]) -> Answer:
        assert row.api is not None
        method, path, sent = _filled(row.api, values)
        options: dict[str, Any] = {"headers": dict(self.tokens[row.who])}
        if isinstance(sent, bytes):
            options |= {"content": sent}
            options["headers"]["content-type"] = "application/zip"
        elif sent == "files":
            options["files"] = _parts(row.files) or [("nothing", (None, ""))]
        else:
            options["json"] = sent
        answer = self.program.request(method, _build_address("/api/v1", path), **options)
        return Answer(answer.status_code, answer.text)

    def _by_command(self, row: Row, values: Mapping[str, str]) -> Answer:
        group, name, *rest = shlex.split(row.command.format(**values))
        output = io.StringIO()
        try:
            with redirect_stdout(output):
                load_command(group, name).main(rest, standalone_mode=False)
        except (RobomarkError, TyperException) as error:
            return Answer(2, str(error))
        return Answer(0, output.getvalue())

    def _restored(self, state: str) -> Snapshot:
        snapshot = self.snapshots.get(state)
        if snapshot is None:
            base = self._restored("course")
            snapshot = _snapshot(self.web, dict(base.values) | self.prepares[state](self.web))
            self.snapshots[state] = snapshot
        self.web.store.engine.dispose()
        _database(self.web).write_bytes(snapshot.data)
        return snapshot

    def _changed(self, snapshot: Snapshot) -> tuple[str, ...]:
        """Return new and removed rows with their tables, except rows that differ only in times."""
        after, lines = _rows(self.web), dict[str, int]()
        for table, rows in after.items():
            columns = snapshot.columns[table]
            for sign, some in ((1, rows - snapshot.rows[table]), (-1, snapshot.rows[table] - rows)):
                for each in some:
                    line = f"{table} {_plain(dict(zip(columns, each, strict=True)), snapshot.ids)}"
                    lines[line] = lines.get(line, 0) + sign
        return tuple(sorted(f"{count:+d} {line}" for line, count in lines.items() if count))


@contextmanager
def installation_in(
    folder: Path, members: Callable[[Web], dict[str, Any]], prepares: Mapping[str, Prepare]
) -> Iterator[Installation]:
    """Create an installation. ``members`` builds the state "course", and returns its people and more ``values``."""
    notices = Notices()
    with pytest.MonkeyPatch.context() as patch, web_in(folder / "home") as web:
        patch.setenv("ROBOMARK_HOME", str(web.settings.home))
        patch.setattr(installation, "_LazyNotifier", lambda _settings, _store: notices)
        context = web.app.state.context
        web.app.state.context = replace(context, service=replace(context.service, notifier=notices))
        made = members(web)
        people = made.pop("people")
        browsers = {}
        for name, each in people.items():
            browser = web.browser(each)
            browsers[name] = (browser, csrf(browser.get("/account")))
        tokens = {name: web.token(each, "read", "submit", "mark", "manage") for name, each in people.items()}
        program = web.browser()
        for token in tokens.values():
            # The first use of a token is stored.
            assert program.get("/api/v1/me", headers=token).is_success
        snapshots = {"course": _snapshot(web, made | {"folder": str(folder)})}
        yield Installation(web, notices, browsers, program, tokens, prepares, snapshots)


def _snapshot(web: Web, values: dict[str, str]) -> Snapshot:
    web.store.engine.dispose()
    rows = _rows(web)
    id_matches = (_ID.findall(each) for some in rows.values() for row in some for each in row if isinstance(each, str))
    ids = frozenset(id_ for some in id_matches for id_ in some)
    return Snapshot(_database(web).read_bytes(), values, rows, _columns(web, rows), ids)


def _database(web: Web) -> Path:
    return web.settings.home / "robomark.db"


def _rows(web: Web) -> dict[str, frozenset[tuple[Any, ...]]]:
    with closing(sqlite3.connect(_database(web))) as connection:
        names = connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'")
        return {name: frozenset(connection.execute(f'SELECT * FROM "{name}"')) for (name,) in names.fetchall()}


def _columns(web: Web, tables: Iterable[str]) -> dict[str, list[str]]:
    with closing(sqlite3.connect(_database(web))) as connection:
        return {name: [each[1] for each in connection.execute(f'PRAGMA table_info("{name}")')] for name in tables}


def _plain(row: dict[str, Any], known: frozenset[str]) -> str:
    """Return a row without the values that differ between requests."""

    def plain(value: Any) -> Any:
        if isinstance(value, bytes):
            return "bytes"
        if not isinstance(value, str):
            return value
        return _ID.sub(lambda match: match[0] if match[0] in known else "new", _TIME.sub("a time", value))

    if "private_hex" in row:
        return "a random key"
    return str({name: plain(value) for name, value in row.items() if name not in _UNEQUAL | _SIGNED})


def _build_address(prefix: str, path: str) -> str:
    """Return the address of a path. A path without a leading slash belongs to course 1."""
    return f"{prefix}{path}" if path.startswith("/") else f"{prefix}/courses/1/{path}"


def _parts(files: Mapping[str, str | bytes]) -> list[tuple[str, tuple[str, io.BytesIO]]]:
    """Return files by ``field:name``, as a browser sends them."""
    parts = []
    for label, content in files.items():
        name, _, file = label.partition(":")
        parts.append((name, (file, io.BytesIO(content if isinstance(content, bytes) else content.encode()))))
    return parts


def _filled(request: Any, values: Mapping[str, str]) -> Any:
    """Return the request with its placeholders replaced."""
    if isinstance(request, str):
        return request.format(**values) if "{" in request else request
    if isinstance(request, tuple):
        return tuple(_filled(each, values) for each in request)
    if isinstance(request, list):
        return [_filled(each, values) for each in request]
    return {name: _filled(each, values) for name, each in request.items()} if isinstance(request, Mapping) else request
