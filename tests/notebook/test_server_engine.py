"""The engine of a server, with a real worker and web server: the same runs as on this machine, and clear refusals."""

from __future__ import annotations

import importlib
import importlib.util
import json
import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any, ClassVar

import pytest

# robomark-notebook needs httpx. The tests of robomark have its successor, which has the same names.
if importlib.util.find_spec("httpx") is None:
    sys.modules["httpx"] = importlib.import_module("httpx2")
httpx: Any = importlib.import_module("httpx")

from builders import asked_already, echo, settings_in  # noqa: E402 - the engine imports httpx
from notebook_builder import document  # noqa: E402
from robomark_notebook import server_engine  # noqa: E402
from robomark_notebook.engine import EngineError, MagicCall, Question  # noqa: E402
from robomark_notebook.server_engine import ServerEngine  # noqa: E402
from service.grading.standalone_runs import RunOptions, load_responder, read_program, run_program  # noqa: E402
from service.grading.trial_runner import TrialRunner  # noqa: E402
from service.queue.embedded_services import EmbeddedServices  # noqa: E402
from service.store.courses import open_assignments  # noqa: E402
from service.store.courses.assignment_versions import freeze_assignment  # noqa: E402
from service.store.engine import open_store  # noqa: E402
from service.store.people.membership import Member  # noqa: E402
from service.web.app import make_app  # noqa: E402
from serving import served  # noqa: E402
from submissions.assignment.examples import locate_examples  # noqa: E402
from web import Web  # noqa: E402

PROGRAM = """
import time
import ev3dev2_glue as glue
print("Colour: 12.5")
print("PY::one")
tank_drive.on_for_seconds(20, 30, 0.5)
print("PY::" + str(glue.pyState()["messages"]))
time.sleep(0.5)
"""
RESPONDER = "def responder(text):\n    return 'JSON::[\"' + text[4:7] + '\"]'\n"
FLAGS = "-b Loop -N 20 -M 10 -L"


def call(body: str | None = PROGRAM, flags: str = f"{FLAGS} -R") -> MagicCall:
    return MagicCall(3, "sim_magic_preloaded", flags, body)


def answer(question: Question) -> str:
    return f'JSON::["{question.text[4:7]}"]'


@dataclass(frozen=True, slots=True)
class Server:
    """A web server with a worker, and a student on it."""

    web: Web
    url: str
    ada: Member

    def token(self, *scopes: str) -> str:
        return self.web.token(self.ada, *scopes)["authorization"].removeprefix("Bearer ")


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    settings = settings_in(asked_already(tmp_path_factory.mktemp("home")), concurrency=1)
    with open_store(settings) as store, EmbeddedServices(settings, store) as services:
        web = Web(services.settings, store, make_app(services.settings, store))
        ada = web.student("ada")
        with store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, "echo-responder")
        with served(web.app) as url:
            yield Server(web, url, ada)


@pytest.fixture(scope="module")
def engine(server: Server) -> Iterator[ServerEngine]:
    one = ServerEngine(server.url, server.token("submit", "read"))
    yield one
    one.close()


def _notebook() -> bytes:
    example = locate_examples("echo-responder") / "reference"
    cells = [
        (example / "responder.py").read_text() + "\nroboSim.pyresponder = responder",
        "%%sim_magic_preloaded -R\n" + (example / "robot.py").read_text(),
    ]
    return json.dumps(document(cells)).encode()


@pytest.mark.long
def test_a_run_has_the_hash_of_robomark_run_with_the_same_answers(
    engine: ServerEngine, tmp_path: Path, runner: TrialRunner
) -> None:
    program, responder = tmp_path / "robot.py", tmp_path / "responder.py"
    program.write_text(f"%%sim_magic_preloaded {FLAGS}\n{PROGRAM}")
    responder.write_text(RESPONDER)
    options = RunOptions(seed=7)
    expected = run_program(
        read_program(program), options, runner, responder=load_responder(str(responder), options.limits)
    )
    questions: list[Question] = []

    def asked(question: Question) -> str:
        questions.append(question)
        return answer(question)

    engine.seed = 7
    result = engine.call_magic(call(), None, asked)
    engine.seed = 0
    assert result.run is not None
    assert result.run.sha256 == expected.recording.sha256
    assert [(each.number, each.text) for each in questions] == [(0, "PY::one"), (1, "PY::[['one']]")]
    assert questions[0].data[0][:2] == ("Colour", 12.5)
    again = engine.call_magic(MagicCall(4, "sim_magic", "-R", None), result.page, answer)
    assert again.run is not None


@pytest.mark.long
def test_a_notebook_is_checked_and_submitted_and_followed(engine: ServerEngine, server: Server) -> None:
    check = engine.check("echo-responder", "ada.ipynb", _notebook(), {"notes.txt": b"1"})
    assert check.marks == check.out_of
    submitted = engine.submit("echo-responder", "ada.ipynb", _notebook(), {})
    assert "attempt 1" in submitted.receipt
    assert submitted.url == f"{server.url}/courses/1/mine/submissions/1"
    deadline = time.monotonic() + 120
    while (submitted := engine.follow(submitted)).before is not None:
        assert time.monotonic() < deadline
        time.sleep(0.2)
    assert submitted.check is not None
    assert (submitted.check.marks, submitted.check.happened) == (submitted.check.out_of, "Full marks.")
    assert submitted.check.replay is not None


def test_a_lost_connection_resumes(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each first attempt of a request is lost, before or after the server has received it."""
    monkeypatch.setattr(server_engine, "_RETRY_SECONDS", 0.01)
    with ServerEngineOver(server, LosingTransport()) as engine:
        result = engine.call_magic(call(), None, answer)
    assert result.run is not None
    assert len([text for _, text in result.run.lines if text.startswith("PY::")]) == 2


class LosingTransport(httpx.HTTPTransport):  # type: ignore[misc]
    """Loses every other request, in turn on the way to the server and on the way back."""

    def __init__(self) -> None:
        super().__init__()
        self._count = 0

    def handle_request(self, request: Any) -> Any:
        self._count += 1
        if self._count % 4 == 1:
            raise httpx.ConnectError("the network is unreachable")
        response = super().handle_request(request)
        if self._count % 4 == 3:
            response.close()
            raise httpx.ReadError("the connection was reset")
        return response


class ServerEngineOver(ServerEngine):
    """An engine over another transport."""

    def __init__(self, server: Server, transport: Any) -> None:
        super().__init__(server.url, server.token("submit"))
        self._client._transport.close()
        self._client._transport = transport

    def __enter__(self) -> ServerEngineOver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def test_an_interrupted_run_does_not_refuse_the_next(engine: ServerEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_engine, "_RETRY_SECONDS", 0.05)

    def interrupt(*_: Any, **__: Any) -> dict[str, Any]:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(engine, "_get", interrupt)
        with pytest.raises(KeyboardInterrupt):
            engine.call_magic(call(), None, answer)
    assert engine.call_magic(call(), None, answer).run is not None


def test_refusals_are_one_sentence_each(engine: ServerEngine, server: Server) -> None:
    with pytest.raises(EngineError, match=r"does not accept this token.*/account\.$"):
        ServerEngine(server.url, "rmt_wrong")
    with pytest.raises(EngineError, match="not a token"):
        ServerEngine(server.url, "two\nlines")
    with pytest.raises(EngineError, match="Connect to the address of your course"):
        ServerEngine(f"{server.url}/courses/99", server.token("submit"))
    with pytest.raises(EngineError, match=r"no open assignment lollipop\. Its assignments are on .*/mine\.$"):
        engine.check("lollipop", "ada.ipynb", _notebook(), {})
    with pytest.raises(EngineError, match=r"^ada\.ipynb"):
        engine.submit("echo-responder", "ada.ipynb", b"{", {})
    with pytest.raises(EngineError, match=r"cannot read the state of the simulator \(page"):
        engine.call_magic(call(), {"background": "Loop"}, answer)
    with pytest.raises(EngineError, match="the most is about 60,000"):
        engine.call_magic(call(), None, lambda _: "x" * 200_000)
    only_reading = ServerEngine(server.url, server.token("read"))
    with pytest.raises(EngineError, match=r"does not have the scope submit\. Create one with"):
        only_reading.call_magic(call(), None, answer)
    only_reading.close()


def test_a_closed_assignment_is_one_sentence(engine: ServerEngine, server: Server) -> None:
    try:
        with server.web.store.transaction() as session:
            open_assignments.close_assignment(session, 1, "echo-responder")
        for ask in (engine.check, engine.submit):
            with pytest.raises(EngineError, match=r"is closed; you can no longer submit to it\.$"):
                ask("echo-responder", "ada.ipynb", _notebook(), {})
    finally:
        with server.web.store.transaction() as session:
            open_assignments.open_for_students(session, 1, "echo-responder")


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("http://robomark.example.org", "Connect with https"),
        ("ftp://robomark.example.org", "is not the address of a server"),
        ("https://user:word@robomark.example.org", "is not the address of a server"),
        ("https://", "is not the address of a server"),
        ("https://[", "is not the address of a server"),
        ("http://localhost:1", r"cannot be reached \(.*\)\. Check"),
        ("nowhere.invalid", r"cannot be reached \(.*\)\. Check"),
    ],
)
def test_addresses_that_are_no_server(address: str, sentence: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_engine, "_UNREACHABLE_SECONDS", 0.0)
    with pytest.raises(EngineError, match=sentence):
        ServerEngine(address, "rmt_token")


class _Other(BaseHTTPRequestHandler):
    """A web server of something else."""

    status: ClassVar[int] = 200

    def do_GET(self) -> None:
        self.send_response(self.status)
        self.send_header("location", "https://elsewhere.example.org/")
        self.end_headers()
        self.wfile.write(b"<html>hello</html>")

    def log_message(self, *_: Any) -> None:
        """Print nothing."""


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (200, "There is no Robomark server"),
        (302, r"at another address \(https://elsewhere"),
        (500, "no Robomark server"),
    ],
)
def test_a_server_of_something_else_gets_no_second_request(
    status: int, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_Other, "status", status)
    with HTTPServer(("127.0.0.1", 0), _Other) as other:
        thread = threading.Thread(target=other.handle_request, daemon=True)
        thread.start()
        with pytest.raises(EngineError, match=sentence):
            ServerEngine(f"http://127.0.0.1:{other.server_address[1]}", "rmt_token")
        thread.join()


def test_a_server_that_never_answers_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_engine, "_UNREACHABLE_SECONDS", 0.0)
    monkeypatch.setattr(server_engine, "_TIMEOUT", httpx.Timeout(0.2))
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with pytest.raises(EngineError, match="cannot be reached"):
            ServerEngine(f"http://127.0.0.1:{silent.getsockname()[1]}", "rmt_token")
