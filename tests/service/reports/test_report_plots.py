"""Plots: the list, their content, and that the same grade gives the same bytes."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import report_builders as build
from service.grading.grade import Accuracy, TrialResult
from service.reports.page import Scene, build_page
from service.reports.plots.confusion import build_confusion_table, draw_confusion
from service.reports.plots.diagram_drawing import draw_diagram
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.grade_plots import draw_all_plots, list_plots
from service.reports.plots.message_counts import build_sequence_diagram
from service.reports.plots.path import draw_path
from service.reports.plots.plot import DPI
from service.reports.plots.png import render_png
from service.reports.plots.sensor import build_panels, build_strips, draw_sensors
from service.reports.plots.sensor_images import crop_focus, select_predictions, to_rgb_image
from service.reports.plots.sequence import Gap, Step, build_conversation
from service.reports.plots.style import WIDTH
from service.reports.view import build_staff_view
from sim.recording import Call, Message, Pose, Recording, TimedText


def _texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if isinstance(text, Text) and text.get_text()]


def _talk(*messages: Message, calls: tuple[Call, ...] = ()) -> Recording:
    return replace(build.line_follower_recording(60), messages=messages, calls=calls)


def test_names_of_all_plots() -> None:
    assert set(draw_all_plots(build.shape_grade())) == {
        "confusion-names-the-right-shape",
        "misread-names-the-right-shape",
        "predictions-names-the-right-shape",
    }


def test_of_a_robot_that_stood_still_the_page_says_so_and_nothing_is_drawn() -> None:
    for scene in build_page(build_staff_view(build.shape_grade())).scenes:
        assert scene.notes[0] == "the robot did not move, so its path and sensors are not drawn"
    for scene in build_page(build_staff_view(build.line_follower_grade())).scenes:
        assert {plot.kind for plot in scene.plots} >= {"path", "sensors"}
        assert not any("stood still" in note for note in scene.notes)


def test_criteria_that_judge_the_same_answers_share_their_images() -> None:
    grade = build.shape_grade()
    (judged,) = (result for result in grade.criteria if result.predictions)
    again = replace(judged, id="says-it-too", title="Says it too")
    both = replace(grade, criteria=(*grade.criteria, again))
    assert draw_all_plots(both).keys() == draw_all_plots(grade).keys()
    (seen,) = build_page(build_staff_view(both)).recognition
    assert [table.title for table in seen.tables] == [judged.title, "Says it too"]
    assert {plot.kind for plot in seen.plots} == {"confusion", "misread", "predictions"}
    other = replace(again, predictions=again.predictions[1:])
    assert len(build_page(build_staff_view(replace(grade, criteria=(*grade.criteria, other)))).recognition) == 2


def test_at_most_256_colours_and_white_stays_white() -> None:
    for data in draw_all_plots(build.line_follower_grade()).values():
        with Image.open(io.BytesIO(data)) as image:
            assert image.mode == "P"
            assert image.convert("RGB").getpixel((image.width - 2, 2)) == (255, 255, 255)


def test_bytes_repeat_and_sizes_are_small() -> None:
    first, second = draw_all_plots(build.line_follower_grade()), draw_all_plots(build.line_follower_grade())
    assert first == second
    for data in first.values():
        with Image.open(io.BytesIO(data)) as image:
            assert image.format == "PNG"
            assert image.width == round(WIDTH * DPI)
            assert 300 < image.height < 2600
            assert "Software" not in image.info
        assert len(data) < 150_000


@pytest.mark.parametrize(
    "positions", [(1e308, -1e308), (1.7e308, 1.7e308), (1e17, 1e17), (5e-324, 0.0), (float("inf"), float("nan"))]
)
@pytest.mark.filterwarnings("error")
def test_readings_of_any_size_are_drawn(positions: tuple[float, float]) -> None:
    grade = build.line_follower_grade()
    trial = grade.trials[0]
    ticks = trial.recording.ticks
    left, right = (np.full(len(ticks), each) for each in positions)
    recording = replace(trial.recording, ticks=replace(ticks, left_position=left, right_position=right))
    assert render_png(draw_sensors(replace(trial, recording=recording), "t"))


def test_a_plot_that_cannot_be_drawn_is_an_image_with_a_sentence(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> Figure:
        raise OverflowError("too large")

    whole = draw_all_plots(build.line_follower_grade())
    monkeypatch.setattr("service.reports.plots.figures.draw_sensors", fail)
    drawn = draw_all_plots(build.line_follower_grade())
    assert drawn.keys() == whole.keys()
    for name, data in drawn.items():
        with Image.open(io.BytesIO(data)) as image:
            assert (data == whole[name]) is not name.startswith("sensors")
            assert image.height > 30
    assert {str(each.exc_info[1]) for each in caplog.records if each.exc_info} == {"too large"}


def test_hidden_trials_are_in_staff_plots_only() -> None:
    for plot in list_plots(build.hidden_grade()):
        if "SECRET" in plot.title or plot.kind in ("confusion", "predictions"):
            assert plot.name.endswith("-staff")
    students = {name for name in draw_all_plots(build.hidden_grade()) if not name.endswith("-staff")}
    assert "predictions-names-the-right-shape" in students
    assert not any("SECRET" in name for name in students)


def test_hostile_text_is_drawn_not_interpreted() -> None:
    drawn = draw_all_plots(build.hostile_grade())
    assert all(len(data) < 150_000 for data in drawn.values())


@pytest.mark.parametrize("count", [0, 1, 2])
def test_trials_that_hardly_began(count: int) -> None:
    trial = TrialResult("short", 0, 1, 0, 0, "visible", build.line_follower_recording(count))
    for drawing in (draw_path(trial, "t", None), draw_sensors(trial, "t")):
        assert render_png(drawing)
    assert ("no time passed" in draw_sensors(trial, "t").texts) is (count == 0)


def test_a_path_that_leaves_the_floor_says_so() -> None:
    recording = build.line_follower_recording(90, "Empty_Map")
    far = replace(
        recording,
        ticks=replace(recording.ticks, x=np.linspace(100, 9000, 90), y=np.full(90, np.nan)),
        end=Pose(9000, 800, 0),
    )
    ticks = replace(far.ticks, y=np.full(90, 800.0))
    path = draw_path(TrialResult("a", 0, 1, 0, 0, "visible", replace(far, ticks=ticks)), "t", None).texts
    assert "the path continues outside this image" in path
    draw_path(TrialResult("a", 0, 1, 0, 0, "visible", far), "t", None)  # no finite tick except the start


def test_path_tells_units_start_end_and_images() -> None:
    path = draw_path(build.shape_grade().trials[4], "Shapes: path", None).texts
    assert {"x, mm", "y, mm", "start", "end", "image sent", "Shapes: path", "1"} <= set(path)
    assert any("from (520, 900) heading 0°" in text for text in path)


def test_sensor_panels_and_events() -> None:
    recording = build.line_follower_grade().trials[1].recording
    light, distance, *_, wheels = build_panels(recording)
    assert [curve.label for curve in light.curves] == ["left", "right"]
    assert distance.curves[0].values[0] == recording.ticks.ultrasonic[0] / 10
    assert np.array_equal(wheels.curves[1].values, recording.ticks.right_position)
    assert [strip.label for strip in build_strips(recording)] == ["said", "touch"]
    sensors = draw_sensors(build.line_follower_grade().trials[1], "t").texts
    assert {"Ultrasonic, cm", "Reflected light, red 0–255", "simulated time, s"} <= set(sensors)


def test_conversation_names_each_party_once_and_orders_nested_calls() -> None:
    trial = build.shape_grade().trials[4]
    conversation = build_conversation(trial.recording)
    assert conversation.parties == ("robot", "responder", "parser", "agent", "logger", "network")
    arrows = [(step.kind, step.source, step.target) for step in conversation.steps if isinstance(step, Step)]
    assert arrows == [
        ("message", "robot", "responder"),
        ("call", "responder", "parser"),
        ("return", "parser", "responder"),
        ("call", "responder", "agent"),
        ("call", "agent", "network"),
        ("return", "network", "agent"),
        ("return", "agent", "responder"),
        ("call", "responder", "logger"),
        ("message", "responder", "robot"),
    ]
    texts = _texts(draw_diagram(build_sequence_diagram(conversation), "t", "", Highlights()))
    assert all(texts.count(party) == 1 for party in conversation.parties)
    inner = [
        line.sender
        for line in build_page(build_staff_view(build.shape_grade())).scenes[0].messages
        if line.kind == "inner"
    ]
    assert inner == [f"{source} → {target}" for kind, source, target in arrows if kind != "message"]


def test_the_diagram_says_why_each_was_lost() -> None:
    steps = [step for step in build_conversation(_talk(*build.ASTRAY)).steps if isinstance(step, Step)]
    assert [(step.kind, step.note, step.label) for step in steps] == [
        ("lost", "lost by chance", "PY::0"),
        ("lost", "out of range", "PY::0 (1601 mm away)"),
        ("lost", "facing away", "PY::0 (91° off)"),
        ("lost", "blocked", "PY::0"),
        ("message", "duplicated, corrupted to PY::7", "PY::0"),
        ("lost", "facing away", "saw 7 (120° off)"),
    ]


def test_of_many_tries_the_one_that_got_through_is_shown() -> None:
    lost = tuple(Message(float(t), "robot", "PY::0", None, None, "lost", "chance") for t in range(30))
    through = (Message(30.0, "robot", "PY::0", 30.0), Message(30.1, "responder", "saw 0", 30.2, 30))
    last = [step for step in build_conversation(_talk(*lost, *through)).steps if isinstance(step, Step)][-2:]
    assert [(step.kind, step.label) for step in last] == [("message", "PY::0"), ("message", "saw 0")]


def test_lost_messages_are_told_apart() -> None:
    conversation = build_conversation(build.faulty_grade().trials[1].recording)
    kinds = [step.kind for step in conversation.steps if isinstance(step, Step)]
    assert kinds == ["message", "lost", "message", "silence", "lost"]
    (talk, *_) = (scene for scene in build_page(build_staff_view(build.faulty_grade())).scenes if scene.messages)
    assert [line.arrived for line in talk.messages if line.kind == "wrong"] == ["never (lost)", "never (lost)"]


def test_long_conversations_are_cut_but_keep_what_went_wrong() -> None:
    messages: list[Message] = []
    for count in range(40):
        messages.append(Message(float(count), "robot", f"PY::{count}", float(count)))
        arrived = None if count == 30 else count + 0.1
        messages.append(
            Message(float(count), "responder", f"saw {count}", arrived, 2 * count, "" if arrived else "lost")
        )
    conversation = build_conversation(_talk(*messages))
    assert (conversation.shown, conversation.total) == (6, 40)
    labels = [step.label for step in conversation.steps if isinstance(step, Step)]
    assert "PY::0" in labels
    assert "saw 30" in labels
    gaps = [step.count for step in conversation.steps if isinstance(step, Gap)]
    assert sum(gaps) == 34
    trial = TrialResult("a", 0, 1, 0, 0, "visible", _talk(*messages))
    (scene,) = build_page(build_staff_view(replace(build.faulty_grade(), trials=(trial,), criteria=()))).scenes
    assert (len(scene.messages), scene.more_messages) == (40, 40)


def test_of_many_messages_and_events_a_page_makes_only_those_that_it_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    messages = [
        Message(float(count), sender, f"PY::{count}", float(count), note="duplicated")
        for count in range(3000)
        for sender in ("robot", "responder")
    ]
    results = ("None", "1", "2")
    calls = tuple(Call(-1 + count // 2, 0, "responder", "parser", "", results[count % 3]) for count in range(1000))
    recording = replace(_talk(*messages, calls=calls), printed=tuple(TimedText(float(t), str(t)) for t in range(3000)))
    monkeypatch.setattr("service.reports.page._MAX_MESSAGES", 100_000)
    all_lines = len(_build_scene(recording).messages)
    monkeypatch.setattr("service.reports.page._MAX_MESSAGES", 40)
    texts: list[str] = []

    def note(text: str, *_: object, **__: object) -> str:
        texts.append(text)
        return ""

    for name in ("abbreviate_message", "to_display_text"):
        monkeypatch.setattr(f"service.reports.page.{name}", note)
    scene = _build_scene(recording)
    assert (len(scene.messages), scene.more_messages) == (40, all_lines - 40)
    assert len(texts) < 200


def _build_scene(recording: Recording) -> Scene:
    trial = TrialResult("a", 0, 1, 0, 0, "visible", recording)
    return build_page(build_staff_view(replace(build.faulty_grade(), trials=(trial,), criteria=()))).scenes[0]


def test_answers_to_nothing_and_strange_indices_are_shown_too() -> None:
    conversation = build_conversation(
        _talk(Message(0.0, "responder", "hello", 0.1, 7), Message(0.2, "responder", "again", 0.3))
    )
    assert [step.label for step in conversation.steps if isinstance(step, Step)] == ["hello", "again"]


def test_confusion_counts_totals_and_missing_answers() -> None:
    accuracy = Accuracy(0.5, 0.2, 0.8, 4, ("a", "b"), (("a", "a", 2), ("b", None, 1), ("b", "zebra", 1)))
    table = build_confusion_table(accuracy)
    assert table.answers == ("a", "b", "zebra", "no answer")
    assert table.counts == ((2, 0, 0, 0), (0, 0, 1, 1))
    assert table.totals == (2, 2)
    confusion = draw_confusion(build.shape_grade().criteria[0], accuracy, "t").texts
    assert any("accuracy 0.50, 95 % interval 0.20 to 0.80, n = 4" in text for text in confusion)
    assert "no answer" in confusion


def test_sensor_images_and_focus() -> None:
    image = build.shape_grade().trials[0].recording.images[0]
    assert to_rgb_image(image).size == (20, 20)
    focus = crop_focus(image)
    assert (focus.size, focus.mode) == ((14, 14), "L")
    assert focus.getpixel((7, 7)) == 0
    assert focus.getpixel((0, 0)) == 255


def test_wrong_images_come_first_when_not_all_fit() -> None:
    predictions = build.shape_grade().criteria[0].predictions * 10
    chosen = select_predictions(predictions)
    assert len(chosen) == 12
    assert [index for index in chosen if index % 6 == 4] == list(range(4, 60, 6))
