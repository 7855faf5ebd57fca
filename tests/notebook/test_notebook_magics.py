"""The magics in a notebook: robots run with the notebook's own responder, and mistakes are one sentence."""

from __future__ import annotations

import re

import pytest

from fake_engine import FakeEngine
from notebook_shell import NotebookShell
from robomark_notebook import session
from robomark_notebook.engine import Engine, EngineError, MagicCall

pytestmark = pytest.mark.fast

RESPONDER = """
import json
count = 0
def counting_responder(text):
    global count
    count += 1
    print("asked", text)
    return "JSON::" + json.dumps({"message": count})
"""
HOOK = "from nbev3devsim.load_nbev3devwidget import roboSim, eds\n%load_ext nbev3devsim\n"
PROGRAM = '%%sim_magic_preloaded -ROHW --collab\nprint("PY::1")\nprint("Light: 3")\nprint("PY::2")\nprint("Light: 4")'


def test_a_run_has_the_answers_of_the_notebook(notebook: NotebookShell) -> None:
    notebook.run(RESPONDER)
    notebook.run(f"{HOOK}roboSim.pyresponder = counting_responder")
    captured = notebook.run(PROGRAM)
    assert notebook.engine.answers == ['JSON::{"message": 1}', 'JSON::{"message": 2}']
    assert captured.stdout == "asked PY::1\nasked PY::2\n"
    assert notebook.shell.user_ns["count"] == 2
    run, lines = captured.outputs
    assert "Robot run of 2.00 s: the program ended" in run.data["text/plain"]
    assert '   0.00 s  JSON::{"message": 1}' in lines.data["text/plain"]


def test_the_engine_gets_cell_name_flags_body_and_seed(notebook: NotebookShell) -> None:
    notebook.run("start = 520")
    notebook.run("%robomark seed 7")
    notebook.run('%%sim_magic_imports -b Simple_Shapes -x {start} -R\nprint("hello")')
    assert notebook.engine.calls == [
        (MagicCall(3, "sim_magic_imports", "-b Simple_Shapes -x 520 -R", 'print("hello")\n'), 7)
    ]


@pytest.mark.parametrize("magic", ["sim_magic", "sim_magic_imports", "sim_magic_preloaded"])
def test_each_magic_works_as_a_line_and_as_a_cell(notebook: NotebookShell, magic: str) -> None:
    notebook.run(f"%{magic} -b Loop")
    notebook.run(f"%%{magic} -R\nprint('x')")
    assert [(call.name, call.body) for call, _ in notebook.engine.calls] == [(magic, None), (magic, "print('x')\n")]


def test_the_page_is_kept_between_magics_and_new_after_a_change_of_engine(notebook: NotebookShell) -> None:
    pages: list[object] = []
    call_magic = notebook.engine.call_magic

    def record_page(call: MagicCall, page: object, answer: object) -> object:
        pages.append(page)
        return call_magic(call, page, answer)

    notebook.engine.call_magic = record_page
    for cell in ("%sim_magic -x 5", "%sim_magic -y 5", "%robomark local", "%sim_magic -a 5"):
        notebook.run(cell)
    assert pages == [None, {"count": 1}, None]
    assert notebook.engine.is_closed


def test_the_log_is_a_data_frame_and_the_responder_sees_it_while_the_robot_runs(notebook: NotebookShell) -> None:
    notebook.run(f"{HOOK}seen = []\ndef responder(text):\n    seen.append(len(roboSim.results_log))\n    return ''")
    notebook.run(PROGRAM)
    assert notebook.shell.user_ns["seen"] == [0, 1]
    notebook.run("df = %sim_data")
    df = notebook.shell.user_ns["df"]
    assert list(df["variable"]) == ["Light", "Light"]
    assert list(df["value"]) == [3, 4]
    notebook.run("images = roboSim.image_data()")
    images = notebook.shell.user_ns["images"]
    assert list(images.columns) == ["side", "vals", "clock"]
    assert len(images) == 2
    notebook.run("%sim_data --clear")
    assert notebook.shell.user_ns["roboSim"].results_log == []


def test_a_responder_may_clear_the_log(notebook: NotebookShell) -> None:
    notebook.run(f"{HOOK}def responder(text):\n    roboSim.clear_datalog()\n    return ''")
    notebook.run(PROGRAM)
    assert [record["Light"] for record in notebook.shell.user_ns["roboSim"].results_log] == [4.0]


def test_the_state_of_the_robot_is_that_of_the_end_of_the_run(notebook: NotebookShell) -> None:
    notebook.run("from nn_tools.sensor_data import report_light_sensor")
    notebook.run('%%sim_magic -R\nprint("x")')
    notebook.run("state = %sim_robot_state")
    state = notebook.shell.user_ns["state"].state
    assert (state["x"], state["y"], state["left_light"]) == (500, 800, 255)
    assert "left" in notebook.text("report_light_sensor(state)").lower()


def test_an_error_in_the_responder_is_shown_with_its_own_line_and_once(notebook: NotebookShell) -> None:
    notebook.run("def responder(text):\n    return nothing_like_this\n")
    captured = notebook.run(PROGRAM)
    assert notebook.engine.answers == [None, None]
    assert captured.stdout.count("NameError") == 2  # the head and the end of one traceback
    assert "return nothing_like_this" in captured.stdout
    assert "kernel_responder" not in captured.stdout
    (*_, lines) = captured.outputs
    assert "0.00 s: no more answers, because the responder ended with NameError" in lines.data["text/plain"]
    assert "returned nothing" not in lines.data["text/plain"]


@pytest.mark.parametrize(
    ("cell", "sentence"),
    [
        ("", "there is no responder: define a function called responder"),
        ("def responder(text):\n    return 3", "the responder returned a value of type int; expected a text"),
        ("roboSim.pyresponder = 'text'", "roboSim.pyresponder is a str and no function"),
    ],
)
def test_a_missing_answer_has_a_note(notebook: NotebookShell, cell: str, sentence: str) -> None:
    notebook.run(HOOK + cell)
    assert sentence in notebook.text(PROGRAM)


def test_a_responder_may_set_the_element_response(notebook: NotebookShell) -> None:
    notebook.run(f"{HOOK}def responder(text):\n    roboSim.set_element('response', 'set ' + text)")
    notebook.run(PROGRAM)
    assert notebook.engine.answers == ["set PY::1", "set PY::2"]


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("%sim_magic --wrong", "There is no flag --wrong."),
        ("%robomark fly", "There is no command fly. Expected one of connect, local, seed, check, submit, help."),
        ("%robomark seed many", "many is not a seed. Expected a whole number from 0."),
        ("%robomark seed", "Expected %robomark seed N."),
        ("%robomark check", "Expected %robomark check ASSIGNMENT [FILE]."),
        ("%robomark 'check", "The line cannot be read: no closing quotation."),
        ("%robomark connect", "Expected %robomark connect URL, or the address in the environment variable ROB"),
        ("%robomark connect ftp://robomark.example", "ftp://robomark.example is not the address of a server"),
        ("%robomark connect http://robomark.example", "Connect with https://robomark.example"),
        ("%robomark connect https://x.example rm_123", "Do not write a token into a notebook."),
        ("%robomark check loop", "There is no notebook in"),
        ("%sim_data --clear 'x", "The flags of %sim_data cannot be read"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(
    notebook: NotebookShell, line: str, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("getpass.getpass", lambda _prompt: "secret")
    captured = notebook.run(line)
    assert captured.stdout == ""
    assert sentence in captured.stderr
    assert captured.stderr.count("\n") == 1
    assert "Traceback" not in captured.stderr


def test_the_token_is_asked_for_and_stays_out_of_the_notebook(
    notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr("getpass.getpass", lambda prompt: asked.append(prompt) or "rm_secret")  # type: ignore[func-returns-value]
    shown = notebook.text("%robomark connect https://robomark.example/")
    assert asked == ["Token for https://robomark.example: "]
    assert "Robots run on https://robomark.example." in shown
    assert "rm_secret" not in shown + repr(notebook.shell.user_ns)


def test_a_connection_that_fails_leaves_the_session_as_it_was(
    notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_url: str, _token: str) -> Engine:
        raise EngineError("The server does not accept this token.")

    monkeypatch.setattr(session, "create_server_engine", refuse)
    monkeypatch.setattr("getpass.getpass", lambda _prompt: "rm_secret")
    assert "does not accept this token" in notebook.run("%robomark connect https://x.example").stderr
    assert "Robots run on this machine." in notebook.text("%robomark")
    notebook.run("%sim_magic -b Loop")
    assert len(notebook.engine.calls) == 1


def test_a_hub_connects_when_a_robot_runs(notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch) -> None:
    connected: list[tuple[str, str]] = []

    def connect(url: str, token: str) -> Engine:
        connected.append((url, token))
        return FakeEngine()

    monkeypatch.setattr(session, "create_server_engine", connect)
    monkeypatch.setenv("ROBOMARK_TOKEN", "rm_secret")
    monkeypatch.setenv("ROBOMARK_URL", "https://hub.example")
    made = session.Session()
    assert (made.url, connected) == ("https://hub.example", []), "a server that is down does not stop the extension"
    made.call_magic(MagicCall(1, "sim_magic", "-b Loop", None), lambda _question: None)
    assert connected == [("https://hub.example", "rm_secret")]


def test_the_token_comes_from_the_environment(notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOMARK_TOKEN", "rm_secret")
    monkeypatch.setenv("ROBOMARK_URL", "https://hub.example")
    monkeypatch.setattr("getpass.getpass", lambda _prompt: pytest.fail("it asked"))
    assert "Robots run on https://hub.example." in notebook.text("%robomark connect")


def test_a_kernel_that_nobody_can_type_into_says_so(notebook: NotebookShell, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_prompt: str) -> str:
        raise RuntimeError("no input")

    monkeypatch.setattr("getpass.getpass", refuse)
    assert "Set the environment variable ROBOMARK_TOKEN" in notebook.run("%robomark connect https://x.example").stderr


def test_the_state_and_the_help(notebook: NotebookShell) -> None:
    assert notebook.run("%robomark").stdout == "Robots run on this machine. Seed: 0. Commands: %robomark help\n"
    commands = re.findall(r"^%robomark (\w+)", notebook.run("%robomark help").stdout, re.MULTILINE)
    assert commands == ["connect", "local", "seed", "check", "submit", "help"]


def test_loading_it_again_keeps_the_session(notebook: NotebookShell) -> None:
    notebook.run("%robomark seed 3")
    notebook.run("%load_ext nbev3devsim\n%reload_ext robomark_notebook")
    assert "Seed: 3." in notebook.text("%robomark")


def test_diagrams_are_shown_as_their_arrows(notebook: NotebookShell) -> None:
    notebook.run("%load_ext blockdiag_magic")
    shown = notebook.text('%%seqdiag\nedge_length = 220;\nrobot -> responder [label = "PY::message"];')
    assert shown.strip() == 'robot -> responder [label = "PY::message"]'
