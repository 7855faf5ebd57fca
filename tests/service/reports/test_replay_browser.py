"""The replay in Chromium, from a file and without a network: the robot is in the right place, and no text runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

import report_builders as build
from browsing import DESKTOP, PHONE, OpenPage, chromium, opened
from replays import long_recording, parting_grade, poisoned
from service.language import ENGLISH, load_language
from service.reports.html import render_replay_page, render_report_page
from service.reports.replay.document import build_grade_replay
from service.reports.replay.labels import translate_labels
from service.reports.replay.overlay import find_divergence
from service.reports.view import BEFORE_PUBLICATION, build_student_view, select_overlay_trials
from sim.floors import build_floor
from sim.recording import Recording

pytestmark = pytest.mark.long

#: The middle of all pixels of this colour, in CSS pixels. For a robot with this axle colour, the middle of its axle.
MIDDLE = """(colour) => {
  const canvas = document.querySelector("canvas.floor");
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let [count, x, y] = [0, 0, 0];
  for (let at = 0; at < data.length; at += 4) {
    if (colour.some((value, part) => data[at + part] !== value)) continue;
    count += 1;
    x += (at / 4) % canvas.width;
    y += Math.floor(at / 4 / canvas.width);
  }
  const ratio = canvas.width / canvas.clientWidth;
  return count ? [(x / count + 0.5) / ratio, (y / count + 0.5) / ratio] : [null, null];
}"""
AXLE_COLOUR, OVER_COLOUR = [230, 0, 126], [0, 166, 147]
REGION = """() => {
  const canvas = document.querySelector("canvas.floor");
  return [...canvas.dataset.region.split(" ").map(Number), canvas.clientWidth, canvas.clientHeight];
}"""
PIXEL = """([x, y]) => {
  const context = document.querySelector("canvas.floor").getContext("2d");
  return [...context.getImageData(x, y, 1, 1).data];
}"""
SEEK = """(t) => {
  const slider = document.querySelector(".moment");
  slider.value = String(t);
  slider.dispatchEvent(new Event("input"));
}"""
HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\u202e\u2028"
WIDTHS = pytest.mark.parametrize("context", [DESKTOP, PHONE], ids=["desktop", "phone"])
SCHEMES = pytest.mark.parametrize("scheme", ["light", "dark"])


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def line_report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("line") / "report.html"
    file.write_text(render_report_page(build_student_view(build.line_follower_grade()), {}, build.faulty_submission()))
    return file


def on_canvas(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the position of a point of the world on the canvas."""
    left, bottom, across, up, width, height = page.evaluate(REGION)
    return (x - left) * width / across, (bottom + up - y) * height / up


def pose_at(recording: Recording, t: float) -> tuple[float, float]:
    """Return the position of the robot at ``t``, interpolated linearly between ticks."""
    ticks = np.arange(len(recording.ticks) + 1) / 30
    x, y = (np.concatenate(([start], values)) for start, values in (
        (recording.start.x, recording.ticks.x), (recording.start.y, recording.ticks.y),
    ))  # fmt: skip
    return float(np.interp(t, ticks, x)), float(np.interp(t, ticks, y))


def assert_robot_is_there(page: Page, recording: Recording, t: float) -> None:
    wanted = on_canvas(page, *pose_at(recording, t))
    position = page.evaluate(MIDDLE, AXLE_COLOUR)
    assert max(abs(position[0] - wanted[0]), abs(position[1] - wanted[1])) <= 1, t


def now(page: Page) -> float:
    return float(page.locator(".moment").evaluate("slider => slider.valueAsNumber"))


def assert_quiet(opened_page: OpenPage, file: Path) -> None:
    assert [each.partition("#")[0] for each in opened_page.requests] == [file.as_uri()]
    assert opened_page.complaints == []


def test_the_robot_is_where_the_recording_has_it_at_twenty_moments(browser: Browser, line_report: Path) -> None:
    recording = build.line_follower_grade().trials[0].recording
    with opened(browser, line_report, "#trial=1&t=0", **DESKTOP) as opened_page:
        for view in ("path", "floor"):
            opened_page.page.locator("select").nth(2).select_option(view)
            for tick in range(0, 300, 15):
                opened_page.page.evaluate(SEEK, tick / 30)
                assert_robot_is_there(opened_page.page, recording, tick / 30)
        opened_page.page.locator("select").nth(2).select_option("near")
        opened_page.page.evaluate(SEEK, 5)
        assert_robot_is_there(opened_page.page, recording, 5)
        assert_quiet(opened_page, line_report)


def test_the_floor_lies_where_the_robot_drives(browser: Browser, line_report: Path) -> None:
    pixels = build_floor("Lollipop").pixels
    chance = np.random.default_rng(1)
    with opened(browser, line_report, "#trial=1&t=0", **DESKTOP) as opened_page:
        opened_page.page.locator("select").nth(2).select_option("floor")
        compared = set()
        for x, y in chance.integers((900, 300), (2300, 1100), (400, 2)).tolist():
            around = pixels[1143 - y - 8 : 1143 - y + 8, x - 8 : x + 8].reshape(-1, 3)
            if (around != around[0]).any():
                continue
            at_x, at_y = on_canvas(opened_page.page, x, y)
            seen = opened_page.page.evaluate(PIXEL, [round(at_x), round(at_y)])
            if np.abs(np.array(seen[:3]) - around[0]).max() <= 3:
                compared.add(tuple(around[0].tolist()))
        assert len(compared) >= 3  # paper, line, and a bar of another colour


def test_the_failed_second_is_reached_by_keyboard(browser: Browser, line_report: Path) -> None:
    recording = build.line_follower_grade().trials[1].recording
    with opened(browser, line_report, **DESKTOP) as opened_page:
        page = opened_page.page
        page.get_by_role("link", name="Watch trial 2 at 4.00 s").focus()
        page.keyboard.press("Enter")
        expect(page.locator(".moment")).to_be_focused()
        assert now(page) == pytest.approx(4)
        assert_robot_is_there(page, recording, 4)
        for key, t in (("Home", 0), ("ArrowUp", 1), ("PageUp", 10), ("PageDown", 0), ("ArrowRight", 0.1), ("End", 10),
                       ("ArrowLeft", 9.9), ("ArrowDown", 8.9)):  # fmt: skip
            page.keyboard.press(key)
            assert now(page) == pytest.approx(t), key
        for _ in range(5):
            page.keyboard.press("ArrowDown")
        page.keyboard.press("ArrowRight")
        assert now(page) == pytest.approx(4)
        assert_robot_is_there(page, recording, 4)
        assert "touched" in page.locator(".happened li").first.inner_text()
        value_text = page.locator(".moment").get_attribute("aria-valuetext")
        assert value_text is not None
        assert value_text.startswith("4.00 of 10.00 s; x ")
        assert_quiet(opened_page, line_report)


def test_in_german_nothing_is_said_in_english(browser: Browser, tmp_path: Path) -> None:
    german = load_language("de")
    file = tmp_path / "report.html"
    file.write_text(
        render_report_page(
            build_student_view(build.line_follower_grade(), language=german), {}, build.faulty_submission()
        )
    )
    spoken, english = translate_labels(german)["sentences"], translate_labels(ENGLISH)["sentences"]
    with opened(browser, file, **DESKTOP) as opened_page:
        page = opened_page.page
        page.get_by_role("link", name="Lauf 2 bei 4.00 s ansehen").press("Enter")
        expect(page.locator(".moment")).to_be_focused()
        page.get_by_text(spoken["allAsTable"]).click()
        expect(page.get_by_role("columnheader", name=spoken["cameOfIt"])).to_be_visible()
        value_text = page.locator(".moment").get_attribute("aria-valuetext")
        assert value_text is not None
        assert value_text.startswith("4.00 von 10.00 s; x ")
        assert "Richtung" in value_text
        assert "Roboter: berührt" in page.locator(".happened li").first.inner_text()
        for name in ("play", "pause"):
            button = page.get_by_role("button", name=spoken[name])
            expect(button).to_be_visible()
            button.click()
        output = page.locator("section.replay").inner_text()
        ours = {words for key, words in english.items() if words != spoken[key] and len(words) > 8 and "%" not in words}
        assert {words for words in ours if words in output} == set()
        assert_quiet(opened_page, file)


def test_the_slider_is_moved_by_touch(browser: Browser, line_report: Path) -> None:
    recording = build.line_follower_grade().trials[1].recording
    with opened(browser, line_report, "#trial=2&t=0", **PHONE) as opened_page:
        page = opened_page.page
        moments = set()
        for part in range(20):
            box = page.locator(".moment").bounding_box()
            assert box is not None
            page.touchscreen.tap(box["x"] + 10 + part * (box["width"] - 20) / 20, box["y"] + box["height"] / 2)
            moments.add(round(now(page), 2))
            assert_robot_is_there(page, recording, now(page))
        assert len(moments) == 20
        page.locator(".losses a").tap()
        assert now(page) == pytest.approx(4)
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert_quiet(opened_page, line_report)


def test_playing_ends_at_the_end_and_starts_again(browser: Browser, line_report: Path) -> None:
    with opened(browser, line_report, "#trial=1&t=0", **DESKTOP) as opened_page:
        page = opened_page.page
        page.locator("select").nth(1).select_option("50")
        page.locator(".moment").focus()
        page.keyboard.press("Space")
        expect(page.locator(".play")).to_have_text("Play")
        assert now(page) == pytest.approx(10)
        page.locator("select").nth(1).select_option("0.25")
        page.locator(".play").click()
        assert now(page) < 9
        page.locator(".play").click()
        assert page.locator(".play").inner_text() == "Play"


def test_the_link_to_the_moment_follows_while_it_plays(browser: Browser, line_report: Path) -> None:
    with opened(browser, line_report, "#trial=1&t=0", **DESKTOP) as opened_page:
        opened_page.page.get_by_role("button", name="Play").click()
        link = opened_page.page.get_by_role("link", name="Link to this moment")
        expect(link).not_to_have_attribute("href", "#trial=1&t=0")
        opened_page.page.wait_for_function(
            "() => { const shown = document.querySelector('.moment').valueAsNumber;"
            " const link = document.querySelector('.choices a').hash; return shown > 0.2"
            " && Math.abs(new URLSearchParams(link.slice(1)).get('t') - shown) < 0.1; }"
        )
        assert_quiet(opened_page, line_report)


def test_with_reduced_motion_it_plays_in_stills(browser: Browser, line_report: Path) -> None:
    with opened(browser, line_report, reduced_motion="reduce", **DESKTOP) as opened_page:
        page = opened_page.page
        page.locator(".play").click()
        frame_times = page.evaluate("""() => new Promise((resolve) => {
          const shown = new Set();
          const until = performance.now() + 2000;
          const look = () => {
            shown.add(document.querySelector(".moment").value);
            if (performance.now() < until) requestAnimationFrame(look);
            else resolve(shown.size);
          };
          look();
        })""")
        assert 2 <= frame_times <= 6


@WIDTHS
def test_ten_minutes_with_500_images_can_be_scrubbed(browser: Browser, tmp_path: Path, context: dict[str, Any]) -> None:
    recording = long_recording(18_000, images=500)
    grade = build.line_follower_grade(2)
    file = tmp_path / "long.html"
    file.write_text(
        render_report_page(
            build_student_view(replace(grade, trials=(replace(grade.trials[0], recording=recording),), criteria=())), {}
        )
    )
    with opened(browser, file, "#t=599.5", **context) as opened_page:
        assert now(opened_page.page) == pytest.approx(599.5)
        assert_robot_is_there(opened_page.page, recording, 599.5)
        opened_page.page.keyboard.press("Home")
        assert_robot_is_there(opened_page.page, recording, 0)
        assert_quiet(opened_page, file)


@WIDTHS
def test_hostile_texts_run_nothing_and_break_nothing(browser: Browser, tmp_path: Path, context: dict[str, Any]) -> None:
    honest = build_grade_replay(build_student_view(build.faulty_grade()), build.faulty_submission())
    images = build_grade_replay(build_student_view(build.shape_grade()))
    both = {**honest, "trials": [*honest["trials"], images["trials"][4]]}
    endless = f"{HOSTILE}{'W' * 1_000_000}"
    pages = {
        "replay.html": render_replay_page(poisoned(both, HOSTILE)),
        "report.html": render_report_page(
            build_student_view(poisoned(build.astray_grade(), endless)),
            {},
            poisoned(build.faulty_submission(), endless),
        ),
    }
    for name, page in pages.items():
        file = tmp_path / name
        file.write_text(page)
        with opened(browser, file, **context) as opened_page:
            replay_page = opened_page.page
            for t in (0, 0.1, 0.4, 1.5):
                replay_page.evaluate(SEEK, t)
            replay_page.locator("section.replay .events summary").click()
            expect(replay_page.locator(".events tbody tr").nth(3)).to_be_visible()
            assert replay_page.locator("section.replay img, section.replay iframe").count() == 0
            assert replay_page.evaluate("document.scripts.length") == 2
            assert replay_page.evaluate("document.documentElement.scrollWidth") <= context["viewport"]["width"]
            assert_quiet(opened_page, file)


@WIDTHS
@SCHEMES
def test_axe_finds_nothing(browser: Browser, tmp_path: Path, context: dict[str, Any], scheme: str) -> None:
    axe = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    file = tmp_path / "report.html"
    file.write_text(render_report_page(build_student_view(build.astray_grade()), {}, build.faulty_submission()))
    with opened(browser, file, "#trial=2&t=0.5", color_scheme=scheme, **context) as opened_page:
        opened_page.page.locator("section.replay .events summary").click()
        opened_page.page.evaluate(axe)
        expect(opened_page.page.locator(".events tbody tr").first).to_be_visible()
        wrong = opened_page.page.evaluate("async () => (await axe.run()).violations.map((each) => each.id)")
        assert wrong == []


@pytest.fixture(scope="module")
def report_of_two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("over") / "report.html"
    view = build_student_view(build.line_follower_grade())
    others = select_overlay_trials(view, parting_grade(), "attempt 1", BEFORE_PUBLICATION)
    file.write_text(render_report_page(view, {}, build.faulty_submission(), overlay_trials=others))
    return file


def assert_both_are_there(page: Page, mine: Recording, other: Recording, t: float) -> None:
    for recording, colour in ((mine, AXLE_COLOUR), (other, OVER_COLOUR)):
        (x, y), (found_x, found_y) = on_canvas(page, *pose_at(recording, t)), page.evaluate(MIDDLE, colour)
        assert found_x is not None, t
        assert max(abs(found_x - x), abs(found_y - y)) <= 1, t


@WIDTHS
def test_the_other_robot_is_where_its_recording_has_it(
    browser: Browser, report_of_two: Path, context: dict[str, Any]
) -> None:
    mine, other = (grade.trials[0].recording for grade in (build.line_follower_grade(), parting_grade()))
    with opened(browser, report_of_two, "#trial=1&t=0", **context) as opened_page:
        opened_page.page.locator("select").nth(2).select_option("floor")
        for t in (4.5, 5, 5.5, 6.1, 7, 7.3):
            opened_page.page.evaluate(SEEK, t)
            assert_both_are_there(opened_page.page, mine, other, t)
        opened_page.page.locator("select").nth(2).select_option("path")
        for t in (5, 8, 9.9, 10.5, 12):  # the first robot's trial ends at 10 s
            opened_page.page.evaluate(SEEK, t)
            assert_both_are_there(opened_page.page, mine, other, t)
        assert_quiet(opened_page, report_of_two)


def test_the_other_trial_is_switched_off_and_on_by_keyboard(browser: Browser, report_of_two: Path) -> None:
    with opened(browser, report_of_two, "#trial=1&t=11.5", **DESKTOP) as opened_page:
        page = opened_page.page
        page.locator("section.replay .events summary").click()
        rows = page.locator(".events tbody tr.of-over")
        assert (now(page), rows.count()) == (11.5, 3)
        expect(page.locator(".happened .of-over").first).to_contain_text("attempt 1: robot: said")
        value_text = page.locator(".moment").get_attribute("aria-valuetext")
        assert value_text is not None
        assert "attempt 1 " in value_text
        box = page.get_by_role("checkbox", name="Overlay attempt 1")
        box.focus()
        page.keyboard.press("Space")
        expect(box).not_to_be_checked()
        assert page.evaluate(MIDDLE, OVER_COLOUR) == [None, None]
        assert page.locator(".play").inner_text() == "Play"
        assert (now(page), rows.count(), page.locator(".happened .of-over").count()) == (10, 0, 0)
        page.keyboard.press("Space")
        page.keyboard.press("End")
        assert (now(page), rows.count()) == (12, 3)
        assert page.evaluate(MIDDLE, OVER_COLOUR) != [None, None]


def test_where_they_part_is_a_link_to_the_moment(browser: Browser, report_of_two: Path) -> None:
    mine, other = (grade.trials[1].recording for grade in (build.line_follower_grade(), parting_grade()))
    moment = find_divergence(mine, other)
    assert moment is not None
    with opened(browser, report_of_two, "#trial=2&t=0", **DESKTOP) as opened_page:
        page = opened_page.page
        page.get_by_role("link", name="First difference: 3.13 s").focus()
        page.keyboard.press("Enter")
        assert moment <= now(page) < moment + 0.001
        expect(page.locator(".moment")).to_be_focused()
        page.evaluate(SEEK, moment - 1 / 30)
        assert "Now 1 mm and 4° apart." in page.locator(".over").inner_text()


@WIDTHS
def test_hostile_texts_of_the_other_trial_run_nothing(
    browser: Browser, tmp_path: Path, context: dict[str, Any]
) -> None:
    view = build_student_view(build.faulty_grade())
    honest = build_grade_replay(
        view, overlay_trials=select_overlay_trials(view, build.astray_grade(), "attempt 1", BEFORE_PUBLICATION)
    )
    file = tmp_path / "replay.html"
    file.write_text(render_replay_page(poisoned(honest, HOSTILE)))
    with opened(browser, file, "#trial=2&t=0.5", **context) as opened_page:
        page = opened_page.page
        page.locator("section.replay .events summary").click()
        expect(page.locator(".events tbody tr.of-over").first).to_be_visible()
        assert page.evaluate("document.scripts.length") == 2
        assert page.locator("section.replay img, section.replay iframe").count() == 0
        assert page.evaluate("document.documentElement.scrollWidth") <= context["viewport"]["width"]
        assert_quiet(opened_page, file)


@WIDTHS
@SCHEMES
def test_axe_finds_nothing_in_two_trials(
    browser: Browser, report_of_two: Path, context: dict[str, Any], scheme: str
) -> None:
    axe = files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
    with opened(browser, report_of_two, "#trial=2&t=6", color_scheme=scheme, **context) as opened_page:
        opened_page.page.locator("section.replay .events summary").click()
        opened_page.page.evaluate(axe)
        expect(opened_page.page.locator(".events tbody tr.of-over").first).to_be_visible()
        assert opened_page.page.evaluate("async () => (await axe.run()).violations.map((each) => each.id)") == []
