"""The outputs of runs and checks: a widget, and forms of it that need none; small, and with all texts escaped."""

from __future__ import annotations

import base64
import io
import json
import re
import sys
import zlib
from dataclasses import replace
from typing import Any

import pytest
from ipywidgets.widgets.widget import _instances
from PIL import Image

from fake_engine import FakeEngine, build_replay
from notebook_shell import NotebookShell
from paths import ROOT
from replays import poisoned
from report_builders import line_follower_recording
from robomark_notebook import outputs, picture, texts
from robomark_notebook.check_report import format_check, format_check_as_html
from robomark_notebook.engine import Check, MagicCall, RobotRun, RunFault
from robomark_notebook.widget import ReplayWidget, build_view
from service.language import ENGLISH
from service.reports.html import load_report_script
from service.reports.replay.document import build_run_replay
from service.reports.replay.labels import translate_labels
from service.reports.replay.sources import Sources

HOSTILE = '<img src=x onerror="alert(1)"></pre><script>alert(2)</script>'
VIEW = "application/vnd.jupyter.widget-view+json"


def run_of(program: str) -> RobotRun:
    result = FakeEngine().call_magic(MagicCall(1, "sim_magic", "-R", program), None, lambda _question: None)
    assert result.run is not None
    return result.run


def check_of() -> Check:
    return FakeEngine().check("stop", "task.ipynb", b"{}", {})


def colours(picture_bytes: bytes) -> set[Any]:
    return {colour for _, colour in Image.open(io.BytesIO(picture_bytes)).convert("RGB").getcolors(1 << 20) or ()}


def test_a_run_is_a_widget_a_picture_and_text(notebook: NotebookShell) -> None:
    run, lines = notebook.run('%%sim_magic -R\nprint("hello <b>you</b>")\nfail').outputs
    assert set(run.data) == {"text/plain", "image/png", VIEW}
    assert run.data["text/plain"] == "Robot run of 2.00 s: the program ended (recording abababababab)"
    assert Image.open(io.BytesIO(base64.b64decode(run.data["image/png"]))).size == (480, 270)
    assert lines.data["text/plain"] == "   0.00 s  hello <b>you</b>\ncell 1, line 2: 'fail' is not defined"
    assert "hello &lt;b&gt;you&lt;/b&gt;" in lines.data["text/html"]


def test_the_widget_has_the_replay() -> None:
    model = build_view(build_replay(["hello"]), "<p>report</p>")[VIEW]["model_id"]
    widget = _instances[model]
    assert json.loads(zlib.decompress(widget.replay)) == build_replay(["hello"])
    assert widget.report == "<p>report</p>"
    assert _instances[build_view(None)[VIEW]["model_id"]].replay == b""


def test_a_notebook_without_pillow_has_no_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    assert picture.draw_last_frame(build_replay(["x"])) is None


def test_a_replay_without_trials_has_no_picture() -> None:
    assert picture.draw_last_frame({**build_replay([]), "trials": []}) is None


@pytest.mark.parametrize("floor", ["Empty_Map", "Simple_Shapes", "FLL_2018_Into_Orbit", "MNIST_Digits"])
def test_the_picture_of_a_real_recording_is_small_and_shows_floor_path_and_robot(floor: str) -> None:
    recording = replace(line_follower_recording(), background=floor)
    made = picture.draw_last_frame(build_run_replay(recording, "cell 1", 0, Sources(), {}))
    assert made is not None
    assert len(made) < 20_000
    assert any(blue > red + 80 for red, _, blue in colours(made)), "the path is blue"


def test_two_robots_are_both_in_the_picture() -> None:
    replay = build_replay([])
    (first,) = replay["trials"][0]["robots"]
    replay["trials"][0]["robots"].append({**first, "start": [200, 300, 0], "end": [500, 300, 0], "columns": {}})
    assert picture.draw_last_frame(replay) != picture.draw_last_frame(build_replay([]))


def test_hostile_texts_are_escaped_in_runs() -> None:
    run = replace(
        run_of('print("x")'),
        lines=((0.0, HOSTILE),),
        faults=(RunFault("program", HOSTILE, HOSTILE, HOSTILE),),
    )
    html = texts.format_run_as_html(run, [HOSTILE], run.faults) + texts.format_notes_as_html([HOSTILE])
    assert "<img" not in html
    assert "<script" not in html
    assert html.count("&lt;script&gt;") == 6


def test_hostile_texts_are_escaped_in_checks() -> None:
    html = format_check_as_html(poisoned(check_of(), HOSTILE))
    tags = {"div", "h3", "p", "b", "table", "thead", "tr", "th", "tbody", "td", "span", "button"}
    assert set(re.findall(r"<(\w+)", html)) <= tags
    assert html.count("&lt;script&gt;") > 8


def test_long_outputs_are_cut() -> None:
    run = replace(run_of('print("x")'), lines=tuple((0.01 * number, "y" * 1000) for number in range(500)))
    text = texts.format_run(run, [], [])
    assert text.count("\n") == 100
    assert "… 400 more lines, which are in the replay …" in text
    assert text.rstrip("y …").endswith("4.99 s")
    assert len(text) < 65_000


def test_a_check_is_told_criterion_by_criterion() -> None:
    assert format_check(check_of()).split("\n") == [
        "Stop at the <line>: 2 of 5 marks. The robot stopped too late.",
        "✓ Prints a line: 2 / 2",
        "  It printed <b>hello</b>.",
        "✗ Stops at the line: 0 / 3",
        "  It stopped 40 mm too late.",
        "Next: Stop earlier.",
        "Note: Hidden trials are not part of a check.",
    ]


def test_a_lost_criterion_has_a_button_for_its_moment() -> None:
    html = format_check_as_html(check_of())
    (button,) = re.findall(r"<button.*?</button>", html)
    assert 'data-moment="#trial=1&amp;t=1.235"' in button
    assert ">Watch at 1.2 s<" in button
    assert " hidden" in button, "it is shown where there is a replay"


def test_the_texts_of_the_replay_are_those_of_the_reports(package: Any) -> None:
    words = json.loads((package / "robomark_notebook" / "replay_words.json").read_text())
    assert words == translate_labels(ENGLISH), (
        "write json.dumps(translate_labels(ENGLISH), indent=1, ensure_ascii=False, sort_keys=True) to replay_words.json"
    )


def test_the_widget_has_the_component_of_the_reports() -> None:
    parts = sorted((ROOT / "service" / "reports" / "replay" / "component").glob("*.js"))
    assert len(parts) >= 7
    for part in parts:
        code = part.read_text()
        assert code in load_report_script()
        assert code in str(ReplayWidget._esm)


def test_the_state_of_a_run_without_trials_is_empty() -> None:
    assert outputs.read_robot_state(replace(run_of("x"), replay={**build_replay([]), "trials": []})) == {}
