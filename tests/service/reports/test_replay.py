"""The replay's data: its content, precision and size, and the data that no reader may find in it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import report_builders as build
from replays import data_of, long_recording, values_of
from responders.source_file import SourceFile
from service.grading.grade import Evidence, Grade
from service.reports.html import render_replay_page, render_report_page
from service.reports.output_files import write_replay
from service.reports.replay.document import build_grade_replay, build_run_replay, compress_replay
from service.reports.replay.sources import Place, Sources, collect_file_sources, collect_sources
from service.reports.transcript import build_transcript
from service.reports.view import build_staff_view, build_student_view
from sim.recording import COLUMNS, Fault, Message, Recording, TimedText, Verdict
from submissions.submission import Cell, Notebook, Submission

KIB = 1024


def run(recording: Recording) -> dict[str, Any]:
    return build_run_replay(recording, "robot.py", 0, Sources(), {})


def with_recording(grade: Grade, recording: Recording) -> Grade:
    return replace(grade, trials=(replace(grade.trials[0], recording=recording),), criteria=())


def test_columns_come_back_as_near_as_a_canvas_needs() -> None:
    recording = build.line_follower_recording(300)
    trial = build_run_replay(recording, "robot.py", 0, Sources(), {})["trials"][0]
    columns = trial["robots"][0]["columns"]
    assert columns.keys() == {each.display_attribute for each in COLUMNS}
    for name, column in columns.items():
        wanted = np.asarray(getattr(recording.ticks, name)).reshape(300, -1)
        assert np.abs(values_of(column) - wanted).max() <= 0.5 / column["per"] + 1e-9, name
    assert columns["x"]["per"] == 100
    assert trial["robots"][0]["pen"] == ((30, True), (200, False))


def test_what_is_not_known_stays_unknown() -> None:
    recording = build.line_follower_recording(4)
    ticks = replace(recording.ticks, ultrasonic=np.array([5.0, np.nan, np.inf, 7.0]), gyro=np.full(4, np.nan))
    robot = build_run_replay(replace(recording, ticks=ticks), "robot.py", 0, Sources(), {})["trials"][0]["robots"][0]
    assert robot["columns"]["ultrasonic"]["added"] == [[50, None, None, 20]]
    assert "gyro" not in robot["columns"]
    compress_replay(run(replace(recording, ticks=ticks)))


@pytest.mark.parametrize("count", [0, 1])
def test_a_recording_without_ticks_has_a_replay(count: int) -> None:
    robot = data_of(render_replay_page(run(build.line_follower_recording(count))))["trials"][0]["robots"][0]
    assert bool(robot["columns"]) is bool(count)


def test_a_minute_is_small_and_ten_minutes_with_500_images_are_not_refused() -> None:
    minute = with_recording(build.line_follower_grade(2), long_recording(1800))
    assert len(render_report_page(build_student_view(minute), {})) < 400 * KIB
    long = with_recording(build.line_follower_grade(2), long_recording(18_000, images=500))
    document = data_of(render_report_page(build_student_view(long), {}))
    assert len(document["trials"][0]["robots"][0]["images"]) == 500


def test_a_report_has_the_worst_trial_and_as_many_others_as_there_is_room_for() -> None:
    grade = build.shape_grade(wrong=4)
    every = build_grade_replay(build_student_view(grade))
    assert [trial["trial"] for trial in every["trials"]] == [1, 2, 3, 4, 5, 6]
    assert every["first"] == 4
    assert len(every["floors"]) == 1
    one = build_grade_replay(build_student_view(grade), max_bytes=1)
    assert [trial["trial"] for trial in one["trials"]] == [5]
    assert (one["first"], one["of"]) == (0, 6)


def test_nothing_hidden_is_in_it() -> None:
    grade = build.hidden_grade()
    student, staff = (data_of(render_report_page(view(grade), {})) for view in (build_student_view, build_staff_view))
    assert "SECRET" not in json.dumps(student)
    assert [trial["trial"] for trial in student["trials"]] == [1, 2, 3, 4]
    assert student["of"] == 4
    assert [trial["name"] for trial in staff["trials"]][4:] == ["SECRETSCENARIO, trial 5", "SECRETSCENARIO, trial 6"]
    assert "SECRETCRITERION" in json.dumps(staff)


def test_staff_alone_learn_what_our_own_code_stumbled_over() -> None:
    fault = Fault(0.1, Verdict.HOST_ERROR, "host", "the machine failed", staff="SECRETTRACE")
    recording = replace(build.line_follower_recording(3), faults=(fault,), sandbox="SECRETLAYERS", sha256="SECRETHASH")
    assert "SECRET" not in json.dumps(run(recording))


def test_a_stand_in_is_not_told_as_a_responder_and_what_is_said_is_told_once() -> None:
    message = Message(1.0, "robot", "PY::0", 1.0)
    answer = Message(1.0, "responder", "pingpong PY::0", 1.0, reply_to=0)
    recording = replace(
        build.line_follower_recording(3),
        messages=(message, answer),
        printed=(TimedText(1.0, "PY::0"), TimedText(1.5, "there")),
        spoken=(TimedText(1.5, "there"),),
    )
    (trial,) = run(recording)["trials"]
    assert [(each["from"], each["to"]) for each in trial["messages"]] == [
        ("robot", "simulator"),
        ("simulator", "robot"),
    ]
    assert [(each["kind"], each["text"]) for each in trial["events"]] == [("printed", "PY::0"), ("said", "there")]
    assert build_transcript(recording) == [
        (1.0, "PY::0"),
        (1.0, "(answer of the simulator) pingpong PY::0"),
        (1.5, "(says) there"),
    ]
    answered = replace(recording, messages=(message, replace(answer, text="circle")))
    assert run(answered)["trials"][0]["messages"][1]["from"] == "responder"
    assert (1.0, "(answer) circle") in build_transcript(answered)


def test_each_lost_criterion_has_its_moment_and_place_and_a_link_to_it() -> None:
    grade = build.line_follower_grade()
    page = render_report_page(build_student_view(grade), {})
    lost = data_of(page)["trials"][1]["lost"]
    assert [(loss["title"], loss["t"], loss["pose"]) for loss in lost] == [
        ("Stays near the line", 4.0, [560.0, 690.0, 100.0])
    ]
    assert 'href="#trial=2&amp;t=4.000">Watch trial 2 at 4.00 s' in page
    never = replace(grade.criteria[0], evidence=(Evidence(0, False, "", None, None),))
    (loss,) = build_grade_replay(build_student_view(replace(grade, criteria=(never,))))["trials"][0]["lost"]
    end = grade.trials[0].recording.end
    assert loss["t"] == grade.trials[0].recording.end_t
    assert loss["pose"] == [round(value, 2) for value in (end.x, end.y, end.heading)]


def test_a_link_leads_only_to_a_trial_that_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.reports.html.REPORT_BYTES", 1)
    grade = build.line_follower_grade()
    elsewhere = replace(grade.criteria[0], evidence=(Evidence(0, False, "", 1.0),))
    assert 'href="#trial=1' in render_report_page(build_student_view(replace(grade, criteria=(elsewhere,))), {})
    other = replace(grade, trials=(grade.trials[0], replace(grade.trials[1], scenario="plain")))
    both = replace(elsewhere, evidence=(Evidence(0, False, "", 1.0), Evidence(1, False, "", 2.0)))
    page = render_report_page(build_student_view(replace(other, criteria=(both,))), {})
    assert 'href="#trial=1' in page
    assert 'href="#trial=2' not in page


def test_images_have_their_pixels_and_what_they_were_taken_for() -> None:
    grade = build.shape_grade(wrong=4)
    grade_replay = build_grade_replay(build_student_view(grade))["trials"][4]["robots"][0]["images"][0]
    assert (grade_replay["truth"], grade_replay["answer"]) == ("upwards facing triangle", "diamond")
    rgba = np.frombuffer(grade.trials[4].recording.images[0].left, np.uint8).reshape(-1, 4)
    assert base64.b64decode(grade_replay["left"]) == rgba[:, :3].tobytes()


def test_messages_have_both_ends_and_what_befell_them() -> None:
    recording = replace(build.line_follower_recording(45), messages=build.ASTRAY)
    messages = build_run_replay(recording, "robot.py", 0, Sources(), {})["trials"][0]["messages"]
    assert [message.get("befell") for message in messages] == [
        "lost by chance",
        "out of range, 1601 mm away",
        "facing away, 91° off",
        "blocked",
        "duplicated, corrupted to PY::7",
        "facing away, 120° off",
    ]
    assert [(message["from"], message["to"]) for message in messages[4:]] == [
        ("robot", "responder"),
        ("responder", "robot"),
    ]
    assert messages[4]["arrived_as"] == "PY::7"
    assert [message["arrived"] for message in messages] == [None, None, None, None, 0.5, None]


@pytest.mark.parametrize(
    ("source", "text", "line"),
    [
        ('a = 1\nprint("PY::0")\nprint("done")\n', "PY::0", 2),
        ('print("x")\nprint("x")\n', "x", None),
        ("print('Light_left:', light)\nprint('end')\n", "Light_left: 42", 1),
        ("print(f'seen {n}')\nprint('done')\n", "seen 4", 1),
        ("print('seen\\t4')\n", "seen\t4", 1),
        ("print(value)\n", "anything", 1),
        ("print(value)\nprint('anything')\n", "anything", None),
        ("# print('no')\nif True: print('yes')\n", "yes", 2),
        ("print('IMG_DATA')\n", 'IMG_DATA::{"left": "1,2"}', 1),
        ("print('other')\n", "not this", None),
        ("(" * 100_000 + "print(" * 1000, "deep", None),
    ],
)
def test_a_line_is_told_only_where_no_other_can_have_written_the_text(source: str, text: str, line: int | None) -> None:
    place = collect_file_sources(SourceFile("robot.py", source), None).find_writing_line(text)
    assert (place and place.line) == line


def test_speech_and_prints_are_told_apart_and_faults_name_their_cell() -> None:
    files = collect_file_sources(
        SourceFile("robot.py", "print('one')\nsay('one')\n"), SourceFile("responder.py", "print('one')\n")
    )
    writing_line = files.find_writing_line("one", is_spoken=True)
    assert writing_line is not None
    assert (writing_line.source, writing_line.line) == (0, 2)
    cells = (Cell(1, "import x"), Cell(2, " "), Cell(3, "%%sim_magic_preloaded -b Loop\nprint('go')"))
    notebook = collect_sources(Submission("s", notebook=Notebook("n.ipynb", cells)))
    assert [source.name for source in notebook.shown] == ["cell 1", "cell 3"]
    went = notebook.find_writing_line("go")
    failed = notebook.find_fault_line(Fault(1.0, Verdict.PROGRAM_ERROR, "program", "no", 2, cell=3))
    assert went == failed
    assert notebook.find_fault_line(Fault(1.0, Verdict.PROGRAM_ERROR, "program", "no", 2, file="helper.py")) is None


def test_hostile_texts_are_visible_and_capped() -> None:
    endless = SourceFile(
        "robot.py", "x" * 1_000_000 + "\n" + "\n".join(f"print({build.HOSTILE!r})" for _ in range(9000))
    )
    submission = replace(build.faulty_submission(), program=endless)
    page = render_report_page(build_student_view(build.hostile_grade()), {}, submission)
    document = json.dumps(data_of(page), ensure_ascii=False)
    assert not {"\x1b", "\x00", "\u202e", "\u200b", "\u2028"} & set(document)
    assert "\\\\u202eevil" in document
    assert "WWWW… (199," in document
    assert data_of(page)["sources"][0]["more"] == 9001 - 3000
    assert data_of(page)["trials"][0]["left_out"] == 3001 - 2000
    assert len(compress_replay(data_of(page))) < 100_000


def test_a_flood_of_messages_is_cut_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []

    def abbreviate(text: str, limit: int) -> str:
        texts.append(text)
        return text[:limit]

    monkeypatch.setattr("service.reports.replay.trial.abbreviate_message", abbreviate)
    flood = tuple(Message(index / 1000, "robot", f"PY::{index}", None) for index in range(5000))
    (trial,) = build_run_replay(replace(build.line_follower_recording(3), messages=flood), "r", 0, Sources(), {})[
        "trials"
    ]
    assert (len(trial["messages"]), trial["left_out"], len(texts)) == (2000, 3000, 2000)


def test_both_robots_are_there_and_say_who_they_are() -> None:
    sent = Message(0.1, "robot", "PY::hi", None, to_partner=True)
    other = replace(build.line_follower_recording(9), messages=(Message(0.1, "partner", "PY::hi", 0.2),))
    recording = replace(build.line_follower_recording(9), messages=(sent,), partner=other)
    (trial,) = build_run_replay(recording, "r", 0, Sources(), {})["trials"]
    assert [robot["name"] for robot in trial["robots"]] == ["robot", "robot 2"]
    assert [(each["from"], each["to"]) for each in trial["messages"]] == [("robot", "robot 2")]


def test_a_floor_of_the_assignments_own_is_shown_and_a_lost_one_left_white() -> None:
    recording = replace(build.line_follower_recording(3), background="own.png")
    photograph = np.random.default_rng(0).integers(0, 256, (1143, 2362, 3), np.uint8)
    (floor,) = build_run_replay(recording, "r", 0, Sources(), {"own.png": photograph})["floors"]
    assert floor["image"].startswith("data:image/webp;base64,")
    (lost,) = build_run_replay(recording, "r", 0, Sources(), {})["floors"]
    assert lost == {"name": "own.png", "image": None}


def test_the_policy_lets_the_script_run_and_nothing_else() -> None:
    page = render_report_page(build_student_view(build.shape_grade()), {}, build.faulty_submission())
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)
    scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    assert len(scripts) == 1
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    assert policy.replace("&#39;", "'").endswith(f"; script-src 'sha256-{digest}'")
    assert "unsafe" not in policy
    assert not re.search(r"innerHTML|outerHTML|insertAdjacent|document\.write|\beval\b|Function\(|fetch\(", scripts[0])
    assert not re.search(r"\son\w+=|style=", page.replace(scripts[0], ""))
    assert "script-src" not in render_report_page(build_student_view(replace(build.shape_grade(), trials=())), {})


def test_a_replay_is_written_as_a_page_or_as_its_data(tmp_path: Path) -> None:
    replay = run(build.line_follower_recording(3))
    write_replay(tmp_path / "run.html", replay)
    write_replay(tmp_path / "run.json", replay)
    data = json.loads((tmp_path / "run.json").read_text())
    assert data == data_of((tmp_path / "run.html").read_text())
    assert (data["format"], data["version"], data["title"]) == ("robomark replay", 1, "robot.py")


def test_the_line_of_a_text_is_looked_up_and_not_searched_for() -> None:
    """Thousands of texts and thousands of printing lines: a search for each text would take minutes."""
    lines = [f"print('{number} is said'); " * 10 for number in range(3000)]
    sources = collect_file_sources(SourceFile("robot.py", "\n".join([*lines[:-1], "print('2999 is said')"])), None)
    began = time.process_time()
    writing_lines = [sources.find_writing_line(f"{number} is said") for _ in range(2) for number in range(3000)]
    assert time.process_time() - began < 5
    assert writing_lines[2999] == writing_lines[-1] == Place(0, 3000)
    assert set(writing_lines) == {None, Place(0, 3000)}


def test_a_wheel_position_of_any_size_is_told() -> None:
    """A program may set a wheel's position to any number. Numbers beyond a browser's whole numbers are cut."""
    recording = build.line_follower_recording(4)
    ticks = replace(recording.ticks, left_position=np.full(4, 1.7e308), right_position=np.full(4, -1.7e308))
    columns = run(replace(recording, ticks=ticks))["trials"][0]["robots"][0]["columns"]
    added = [columns[name]["added"][0][0] for name in ("left_position", "right_position")]
    assert added == pytest.approx([2**52, -(2**52)], abs=10)
