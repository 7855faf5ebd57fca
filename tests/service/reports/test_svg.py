"""Plots as SVG: complete documents, escaped texts, readable on dark pages, as small as their content allows."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.markers import MarkerStyle

import report_builders as build
from service.reports.html import render_report_page
from service.reports.plots.drawing import Drawing, Rectangle, Stroke, create_drawing
from service.reports.plots.grade_plots import draw_all_plots, draw_vector_plots
from service.reports.plots.panel import Panel
from service.reports.plots.style import FAULT, HEAD, INK, LEFT, RIGHT, RULE
from service.reports.plots.svg import render_svg
from service.reports.plots.svg_paths import UNITS, simplify_line, write_path
from service.reports.view import build_student_view

_SVG = "{http://www.w3.org/2000/svg}"
_ELEMENTS = {"svg", "title", "style", "defs", "clipPath", "pattern", "g", "path", "use", "image", "text"}
_ROOT = Path(__file__).parents[3]


def parse(document: str) -> ElementTree.Element:
    """Return the root of a document, of which a browser would load and run nothing else."""
    root = ElementTree.fromstring(document)
    for element in root.iter():
        assert element.tag.removeprefix(_SVG) in _ELEMENTS
        for name, value in element.attrib.items():
            assert not name.startswith("on")
            assert name != "style"
            assert name != "href" or value.startswith(("#", "data:image/png;base64,", "data:image/webp;base64,"))
            assert "url(" not in value or value.startswith("url(#")
    assert "@import" not in document
    assert "url(" not in (next(root.iter(f"{_SVG}style")).text or "")
    return root


def list_texts(root: ElementTree.Element) -> list[str]:
    return ["".join(element.itertext()) for element in root.iter(f"{_SVG}text")]


def draw_panel() -> Panel:
    """Return a panel in a drawing of 3 x 2 inches."""
    return Panel(Drawing(3.0, 2.0), Rectangle(0.5, 0.25, 2.0, 1.0), (0, 10), (0, 5))


@given(st.text(), st.text(), st.booleans())
def test_hostile_texts_stay_texts(title: str, label: str, has_background: bool) -> None:
    drawing = create_drawing(HEAD + 1, title, label)
    image = f"'/><image href='http://x/{label}'/>"
    for text in (label, f"</text><script>{label}</script>", image, "]]>&amp;\x00\x1b\ud800"):
        drawing.add_text(1, 1, text, background="white" if has_background else None)
    root = parse(render_svg(drawing, title))
    assert "</text><script>" in "".join(list_texts(root))
    assert all(
        character.isprintable() or character in "\u200c\u200d" for each in list_texts(root) for character in each
    )
    assert len(list(root.iter(f"{_SVG}title"))) == 1


@given(st.lists(st.tuples(st.floats(), st.floats()), max_size=30), st.sampled_from(["o", "x", "D", "*", (3, 0, 45)]))
def test_any_values_give_a_document(points: list[tuple[float, float]], marker: object) -> None:
    panel = draw_panel()
    data = np.array(points, np.float64).reshape(-1, 2)
    with np.errstate(all="ignore"):
        panel.add_line(data, Stroke(LEFT, 1))
        panel.add_area(data, fill=RIGHT, opacity=0.5, hatched=True)
        panel.add_marks(data, MarkerStyle(marker), 4, fill=RIGHT)  # type: ignore[arg-type]
        root = parse(render_svg(panel.drawing, "t"))
    for element in root.iter(f"{_SVG}path"):
        assert re.fullmatch(r"M[-MLlhvHVaz0-9 ]*", element.attrib["d"])


@pytest.mark.parametrize("build_grade", [build.line_follower_grade, build.swept_grade, build.hostile_grade])
def test_plots_are_complete_documents_and_smaller_than_images(build_grade: object) -> None:
    grade = build_grade()  # type: ignore[operator]
    documents, images = draw_vector_plots(grade), draw_all_plots(grade)
    assert documents
    for name, document in documents.items():
        assert list_texts(parse(document))
        assert len(document) < 4 / 3 * len(images[name])


def test_documents_are_the_same_in_any_process() -> None:
    code = (
        "import hashlib, report_builders as build\n"
        "from service.reports.plots.grade_plots import draw_vector_plots\n"
        "for grade in (build.line_follower_grade(), build.swept_grade()):\n"
        "    for name, text in draw_vector_plots(grade).items(): print(name, hashlib.sha256(text.encode()).hexdigest())"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": f"{_ROOT}:{_ROOT / 'tests/helpers'}"}
    output = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    ).stdout
    expected_lines = [
        f"{name} {hashlib.sha256(text.encode()).hexdigest()}"
        for grade in (build.line_follower_grade(), build.swept_grade())
        for name, text in draw_vector_plots(grade).items()
    ]
    assert output.splitlines() == expected_lines


def test_only_what_is_on_the_page_itself_changes_its_colour() -> None:
    panel = draw_panel()
    panel.add_frame()
    panel.add_text(5, 2, "on paper", colour=FAULT)
    panel.add_rectangle((0, 0), 6, 5, fill="white", edge=Stroke(RULE, 1))
    panel.add_text(5, 4, "on a card", colour=FAULT)
    panel.add_line([(1, 1), (9, 1)], Stroke(LEFT, 1))
    panel.add_line([(1, 1), (5, 1)], Stroke(RIGHT, 1))
    panel.add_text(8, 2, "has a ground", colour=FAULT, background="white")
    root = parse(render_svg(panel.drawing, "t"))
    on_paper = [each for group in root.iter(f"{_SVG}g") if group.get("class") == "ink" for each in group]
    assert [each.text for each in on_paper if each.text] == ["on paper"]
    assert [each.get("stroke") for each in on_paper if each.get("stroke")] == [RULE, LEFT]
    style = next(root.iter(f"{_SVG}style")).text or ""
    assert style.startswith("@media screen and (prefers-color-scheme:dark)")
    assert f"[stroke='{LEFT}']" in style
    assert f"[stroke='{INK}']" not in style


def test_a_shared_line_is_written_once() -> None:
    panel = draw_panel()
    angles = np.linspace(0, 6, 300)
    points = np.column_stack((5 + 4 * np.cos(angles), 2.5 + 2 * np.sin(angles)))
    panel.add_line(points, Stroke("white", 3))
    panel.add_line(points, Stroke(LEFT, 1))
    root = parse(render_svg(panel.drawing, "t"))
    assert [each.get("stroke") for each in root.iter(f"{_SVG}use")] == ["white", LEFT]


def test_curves_over_time_keep_their_range_and_their_gaps() -> None:
    times = np.linspace(0, 3 * UNITS, 50_000)
    values = np.random.default_rng(1).normal(500, 100, len(times))
    values[20_000:30_000] = np.nan
    before, after = simplify_line(np.column_stack((times, values)))
    assert len(before) + len(after) < 1300
    assert before[-1, 0] < times[20_000] < times[29_999] < after[0, 0]
    assert max(before[:, 1].max(), after[:, 1].max()) == np.nanmax(values)
    assert min(before[:, 1].min(), after[:, 1].min()) == np.nanmin(values)


def test_a_straight_path_needs_two_points_and_repeated_points_one() -> None:
    straight = np.column_stack((np.linspace(900, 0, 400), np.linspace(0, 300, 400)))
    (line,) = simplify_line(straight)
    assert len(line) <= 3
    assert write_path(np.array([(5.0, 5.0)] * 9)) == "M5 5h0"
    assert write_path(np.array([(0.0, 10.0), (5.0, 7.0), (5.0, 7.2), (9.0, 20.0)])) == "M0 10l5-3 4 13"


def test_pictures_are_cut_and_photographs_stay_small() -> None:
    panel = draw_panel()
    noise = np.random.default_rng(2).integers(0, 256, (60, 120, 3), np.uint8).repeat(10, axis=0).repeat(10, axis=1)
    smooth = np.linspace(0, 255, 1200, dtype=np.uint8)[None, :, None] + noise // 8
    panel.add_picture(smooth, -100, -50, 100, 50)
    document = render_svg(panel.drawing, "t")
    (image,) = parse(document).iter(f"{_SVG}image")
    assert 2000 <= int(image.attrib["width"]) < 2100
    assert image.attrib["href"].startswith("data:image/")
    assert len(document) < 30_000


def test_reports_show_vector_plots_as_svg_even_before_any_plot_is_stored() -> None:
    grade = build.line_follower_grade()
    for plots in (draw_all_plots(grade), {}):
        page = render_report_page(build_student_view(grade), plots)
        sources = re.findall(r'<img src="([^"]+)" width="(\d+)" height="(\d+)"', page)
        assert {source.partition(",")[0] for source, _, _ in sources} == {"data:image/svg+xml"}
        for source, width, height in sources:
            root = parse(unquote(source.partition(",")[2]))
            assert (root.get("width"), root.get("height")) == (width, height)


def test_a_vector_plot_that_cannot_be_drawn_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> Drawing:
        raise OverflowError("too large")

    monkeypatch.setattr("service.reports.plots.figures.draw_sensors", fail)
    grade = build.line_follower_grade()
    texts = {name: " ".join(list_texts(parse(text))) for name, text in draw_vector_plots(grade).items()}
    assert {"cannot be drawn" in text for name, text in texts.items() if name.startswith("sensors")} == {True}
    assert {"cannot be drawn" in text for name, text in texts.items() if name.startswith("path")} == {False}
