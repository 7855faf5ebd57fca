"""A notebook's diagrams compared with the recording: the differences, in the drawings and in words."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

import report_builders as build
from service.grading.grade import Grade
from service.reports.html import render_report_page
from service.reports.plots.diagram_differences import Differences, compare_with_recording, describe_differences
from service.reports.plots.diagram_drawing import draw_diagram, draw_own_diagram
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.grade_plots import draw_all_plots, list_plots
from service.reports.plots.message_counts import MessageCount, build_block_diagram, count_messages
from service.reports.plots.own_diagrams import list_own_diagrams
from service.reports.plots.png import render_png
from service.reports.view import build_staff_view, build_student_view
from sim.recording import Call, Message
from submissions.diagram import DiagramKind
from submissions.diagram_cells import DiagramCell
from submissions.diagram_text import MAX_ACTORS, MAX_STEPS, read_diagram
from submissions.submission import Cell, Notebook, Submission

#: The trials of ``build.shape_grade``, as a notebook draws them.
TRUE = (
    "robot -> responder -> parser; responder <- parser; responder -> agent -> MLP; agent <- MLP; responder <- agent;"
    "responder --> logger; robot <- responder"
)
#: The seed's drawing: the agent asks for the message to be parsed, which its program does not do.
SEED = (
    "robot -> responder -> agent -> parser; agent <- parser; agent -> MLP; agent <- MLP; responder <- agent;"
    "responder --> logger; robot <- responder"
)


def find_differences(text: str, kind: DiagramKind = "seqdiag") -> Differences | None:
    return compare_with_recording(read_diagram(kind, text), count_messages(build.shape_grade().trials[0].recording))


def cells(*texts: str) -> Sequence[DiagramCell]:
    """Return cells 1, 2 ...; a text without dashes is a block diagram."""
    return [
        DiagramCell(number, read_diagram("blockdiag" if "<->" in text else "seqdiag", text))
        for number, text in enumerate(texts, 1)
    ]


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(Text) if isinstance(text, Text) and text.get_text()]


def talk_grade(*messages: Message, calls: tuple[Call, ...] = ()) -> Grade:
    grade = build.shape_grade()
    recording = replace(grade.trials[0].recording, messages=messages, calls=calls)
    return replace(grade, trials=(replace(grade.trials[0], recording=recording),))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (TRUE, "The diagram matches the events."),
        (
            SEED,
            "agent → parser and parser → agent did not happen. responder → parser happened and is not drawn.",
        ),
        ("robot -> responder", "parser, agent, MLP and logger took part and are not drawn. "
         "responder → robot happened and is not drawn."),
        (TRUE.replace("MLP", "digit_net [label = 'a network']"), "The diagram matches the events."),
        (TRUE + "; teacher -> robot", "teacher took no part."),
        (TRUE + "; responder -> MLP", "responder → MLP did not happen."),
        (TRUE + "; responder -> responder [label = think]", "The diagram matches the events."),
        (TRUE.replace("responder <- parser;", ""), "The diagram matches the events."),
        ("bot [label = Robot]; a [label = 'Python message\\nhandler']; bot -> a; a -> bot",
         "parser, agent, MLP and logger took part and are not drawn."),
    ],
)  # fmt: skip
def test_differences_in_words(text: str, sentence: str) -> None:
    differences = find_differences(text.replace("agent -> digit_net [label = 'a network']", "agent -> digit_net"))
    assert differences is not None
    assert describe_differences(differences) == sentence


def test_a_way_may_lead_through_who_is_not_drawn() -> None:
    differences = find_differences("robot <-> python <-> mlp", "blockdiag")
    assert differences is not None
    assert differences.drawn_arrows == ()
    assert find_differences("robot <-> python <-> mlp; agent", "blockdiag").drawn_arrows == (("python", "mlp"),)  # type: ignore[union-attr]


@pytest.mark.parametrize("text", ["input -> hidden -> output", "robot -> charger", "a -> b"])
def test_a_diagram_of_something_else_is_not_compared(text: str) -> None:
    assert find_differences(text) is None


def test_long_lists_are_cut() -> None:
    words = describe_differences(Differences(tuple(f"actor {number}" for number in range(12))))
    assert words == "actor 0, actor 1, actor 2, actor 3, actor 4 and 7 more took no part."


def test_talks_are_counted_with_what_was_lost() -> None:
    calls = (Call(0, 0, "responder", "parser", "", "1"), Call(2, 0, "responder", "parser", "", "None"))
    messages = (
        Message(0.0, "robot", "PY::1", 0.0),
        Message(0.0, "responder", "1", 0.1, 0),
        Message(1.0, "robot", "PY::2", 1.0),
        Message(2.0, "robot", "PY::3", None),
    )
    message_counts = count_messages(talk_grade(*messages, calls=calls).trials[0].recording)
    assert message_counts == (
        MessageCount("robot", "responder", "message", 3, 1),
        MessageCount("responder", "robot", "message", 1),
        MessageCount("responder", "parser", "call", 2),
        MessageCount("parser", "responder", "return", 1),
    )
    drawn = build_block_diagram(message_counts)
    assert [(arrow.label, arrow.heads) for arrow in drawn.arrows] == [
        ("3, 1 lost", "target"),
        ("1", "target"),
        ("2", "both"),
    ]


def test_many_networks_are_few_blocks() -> None:
    calls = tuple(Call(0, 0, "responder", f"net{number}", "", "1") for number in range(40))
    drawn = build_block_diagram(
        count_messages(talk_grade(Message(0.0, "robot", "PY::1", 0.0), calls=calls).trials[0].recording)
    )
    assert [actor.name for actor in drawn.actors][2:] == ["net0", "net1", "net2", "net3", "other networks"]
    assert drawn.arrows[-1].label == "36"


def test_the_one_most_like_it_of_each_kind_is_compared() -> None:
    grade = build.shape_grade()
    drawn = list_own_diagrams(
        grade, cells("robot -> responder; robot <- responder", SEED, "a -> b", "robot <-> python")
    )
    assert [bool(own.words) for own in drawn] == [False, True, False, True]
    assert [[plot.kind for plot in own.plots] for own in drawn] == [
        ["own"],
        ["own", "happened"],
        ["own"],
        ["own", "happened"],
    ]
    assert [own.words for own in list_own_diagrams(talk_grade(), cells(SEED))] == [""]


def test_what_differs_is_highlighted_in_both_drawings() -> None:
    grade = build.shape_grade()
    (own,) = list_own_diagrams(grade, cells(SEED))
    left, right = (texts(draw_own_diagram(own, grade, plot)) for plot in own.plots)
    assert sum(text.startswith("✗") for text in left) == 3  # two arrows and the legend
    assert sum(text.startswith("+") for text in right) == 2
    assert left.count("parser") == right.count("parser") == 1
    (same,) = list_own_diagrams(grade, cells(TRUE))
    assert not any(text[0] in "✗+" for plot in same.plots for text in texts(draw_own_diagram(same, grade, plot)))


def test_what_happened_has_the_order_of_the_notebook() -> None:
    grade = build.shape_grade()
    (own,) = list_own_diagrams(grade, cells("logger; MLP; agent; robot -> responder"))
    heads = [
        text
        for text in texts(draw_own_diagram(own, grade, own.plots[1]))
        if text in "logger network agent robot responder"
    ]
    assert heads == ["logger", "network", "agent", "robot", "responder"]


def test_the_page_has_both_drawings_and_the_sentence() -> None:
    grade = build.shape_grade()
    grade = replace(grade, trials=grade.trials[:1], criteria=())
    notebook = Notebook("ada.ipynb", (Cell(1, "x = 1"), Cell(2, f"%%seqdiag\n{SEED}"), Cell(3, "%%seqdiag\na -> <b>")))
    submission = Submission("ada", notebook=notebook)
    read = [DiagramCell(2, read_diagram("seqdiag", SEED))]
    drawn = draw_all_plots(grade, cells=read)
    assert {"own-cell-2-each-shape-1", "happened-cell-2-each-shape-1"} == set(drawn)
    page = render_report_page(build_student_view(grade), drawn, submission)
    assert "agent → parser and parser → agent did not happen." in page
    assert "Your diagram: Cell 2: sequence diagram" in page
    assert page.count("<img") == len(drawn)
    assert "Your diagram" not in render_report_page(build_student_view(grade), drawn)


def test_a_hidden_trial_is_compared_for_staff_only() -> None:
    grade = build.shape_grade()
    hidden = replace(grade, trials=tuple(replace(trial, visibility="hidden") for trial in grade.trials))
    (for_staff,) = list_own_diagrams(build_staff_view(hidden).grade, cells(SEED))
    (for_student,) = list_own_diagrams(build_student_view(hidden).grade, cells(SEED))
    assert all(plot.name.endswith("-staff") for plot in for_staff.plots)
    assert for_student.words == ""
    assert [plot.name for plot in for_student.plots] == ["own-cell-1"]
    some = replace(grade, trials=(hidden.trials[0], *grade.trials[1:]))
    both = [
        list_own_diagrams(view.grade, cells(SEED))[0] for view in (build_staff_view(some), build_student_view(some))
    ]
    assert [plot.name for plot in both[0].plots] == [plot.name for plot in both[1].plots]
    assert not any("staff" in plot.name for plot in both[0].plots)
    moving = build.line_follower_grade()
    kept = tuple(replace(trial, visibility="hidden") for trial in moving.trials)
    names = {plot.name for plot in list_plots(replace(moving, trials=kept)) if plot.scenario}
    assert names
    assert all(name.endswith("-staff") for name in names)


HOSTILE = (
    'a [label="<script>$\\\\frac{1}{ \u202e\ud800\x00 \\n\\n\\n\\n x", color=C0]; a -> b [label="$$ {{7*7}} '
    + "x" * 400
    + '"]'
)


_LARGEST = f"a -> b [label = '{'very ' * 20}\\n{'long ' * 20}'];" * MAX_STEPS


@pytest.mark.long
@pytest.mark.parametrize("kind", ["blockdiag", "seqdiag"])
@pytest.mark.parametrize(
    "text",
    [
        HOSTILE,
        "a",
        "a -> a",
        "a -> b; b -> a; a -> a",
        "group { a; b } group g { b; c } a -> b -> c -> a",
        "".join(f"{one} -> b{other};" for one in "xyz" for other in range(8)),
        " -> ".join(f"actor_number_{number}" for number in range(MAX_ACTORS)),
        pytest.param(_LARGEST, id="largest", marks=pytest.mark.long),
    ],
)  # fmt: skip
def test_whatever_is_drawn_fits_into_memory_and_repeats(kind: DiagramKind, text: str) -> None:
    diagram = read_diagram(kind, text)
    highlights = Highlights(frozenset({"a"}), frozenset({("a", "b")}), words="marked")
    first, second = (render_png(draw_diagram(diagram, "t", "s", highlights)) for _ in range(2))
    assert first == second
    _assert_small(first)


def test_the_largest_drawing_fits_into_memory() -> None:
    _assert_small(render_png(draw_diagram(read_diagram("seqdiag", _LARGEST), "t", "s", Highlights())))


def _assert_small(drawing: bytes) -> None:
    with Image.open(io.BytesIO(drawing)) as image:
        assert image.width * image.height <= 6_100_000
    assert len(drawing) < 800_000
