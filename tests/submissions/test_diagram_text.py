"""The language of %%blockdiag and %%seqdiag cells: its meaning, and that no text has other effects."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from notebook_builder import MESSAGING
from sim.errors import UsageError
from submissions.diagram import Diagram, DiagramActor, DiagramArrow, DiagramKind, Divider
from submissions.diagram_cells import MAX_DIAGRAMS, MAX_PARTS, read_diagrams
from submissions.diagram_text import MAX_ACTORS, MAX_DEPTH, MAX_GROUPS, MAX_STEPS, read_diagram
from submissions.diagram_tokens import MAX_CHARACTERS
from submissions.notebook import read_notebook
from submissions.submission import Cell, Notebook


def list_texts(diagram: Diagram) -> list[str]:
    """Return the steps, one per line."""
    return [
        f"--- {step.text}"
        if isinstance(step, Divider)
        else f"{step.source} > {step.target}" + (f": {step.label}" if step.label else "")
        for step in diagram.steps
    ]


def refusal(kind: DiagramKind, text: str) -> str:
    with pytest.raises(UsageError) as raised:
        read_diagram(kind, text)
    return str(raised.value)


@pytest.mark.parametrize(
    ("kind", "text", "steps"),
    [
        ("seqdiag", "a -> b;", ["a > b"]),
        ("seqdiag", "seqdiag { a -> b; }", ["a > b"]),
        ("seqdiag", "diagram protocol { a -> b }", ["a > b"]),
        ("seqdiag", "{ a -> b }", ["a > b"]),
        ("seqdiag", "seqdiag -> b", ["seqdiag > b"]),
        ("seqdiag", "a<-b", ["b > a"]),
        ("seqdiag", "a-b -> c_d.e", ["a-b > c_d.e"]),
        ("seqdiag", "a -> b -> c [label = 'x\\ny'];", ["a > b: x\ny", "b > c: x\ny"]),
        ("seqdiag", 'a -> b <- c [label="say \\"hi\\""]', ['a > b: say "hi"', 'c > b: say "hi"']),
        ("seqdiag", "a => b [label=ask, return=told]", ["a > b: ask", "b > a: told"]),
        ("seqdiag", "a => b => c", ["a > b", "b > c", "c > b", "b > a"]),
        ("seqdiag", "a => b { b -> c; b <-- c }", ["a > b", "b > c", "c > b", "b > a"]),
        ("seqdiag", "a -> b; === later on === a -> b ... wait ...", ["a > b", "--- later on", "a > b", "--- wait"]),
        ("seqdiag", "loop often { a -> b }", ["--- loop often", "a > b", "--- end of loop"]),
        ("seqdiag", "autonumber = True; a -> b; a <- b [label=x]", ["a > b: 1.", "b > a: 2. x"]),
        ("seqdiag", "// a -> x\n/* a -> y\n*/ a -> b; # a -> z", ["a > b"]),
        ("seqdiag", "default_fontsize = 24; edge_length = 220; activation = none; a -> b", ["a > b"]),
        ("seqdiag", "größe -> 機器人", ["größe > 機器人"]),
        ("seqdiag", "'two words' -> b", ["two words > b"]),
        ("blockdiag", "a <-> b -- c", ["a > b", "b > c"]),
        ("blockdiag", "a, b -> c, d", ["a > c", "a > d", "b > c", "b > d"]),
        ("blockdiag", "a -> b [dir = back, label = x]", ["b > a: x"]),
        ("blockdiag", "class note [label = 'of a class']; a -> b [class = note]", ["a > b: of a class"]),
        ("blockdiag", "group outer { color = pink; a; group { b -> c } } d", ["b > c"]),
    ],
)
def test_steps(kind: DiagramKind, text: str, steps: list[str]) -> None:
    assert list_texts(read_diagram(kind, text)) == steps


def test_actors_have_what_was_said_of_them_wherever_it_was() -> None:
    diagram = read_diagram(
        "blockdiag", "b -> a; default_shape = note; a [label = 'A\\nb', shape = ellipse, color = '#abc']"
    )
    assert diagram.actors == (
        DiagramActor("b", "b", "note"),
        DiagramActor("a", "A\nb", "ellipse", "#abc"),
    )


def test_groups_have_all_that_is_in_them() -> None:
    diagram = read_diagram("blockdiag", "orientation = portrait; group outer { color = pink; a; group { b -> c } } d")
    assert [(group.label, group.members, group.colour) for group in diagram.groups] == [
        ("", ("b", "c"), ""),
        ("outer", ("a", "b", "c"), "pink"),
    ]
    assert diagram.portrait
    assert [actor.name for actor in diagram.actors] == ["a", "b", "c", "d"]


@pytest.mark.parametrize(
    ("sign", "line", "heads", "open_head"),
    [
        ("->", "solid", "target", False),
        ("-->", "dashed", "target", False),
        ("->>", "solid", "target", True),
        ("-->>", "dashed", "target", True),
        ("<->", "solid", "both", False),
    ],
)
def test_arrows_keep_their_style(sign: str, line: str, heads: str, open_head: bool) -> None:
    (arrow,) = read_diagram("seqdiag", f"a {sign} b").arrows
    assert (arrow.line, arrow.heads, arrow.open_head) == (line, heads, open_head)


def test_attributes_of_arrows() -> None:
    (arrow,) = read_diagram(
        "seqdiag", "a -> b [failed, style = dotted, color = red, leftnote = 'look', diagonal]"
    ).arrows
    assert arrow == DiagramArrow("a", "b", "", "dotted", failed=True, colour="red", note="look", note_side="left")


@pytest.mark.parametrize(
    ("kind", "text", "sentence"),
    [
        ("seqdiag", "", "line 1: there is nothing to draw, expected lines like a -> b;"),
        ("seqdiag", "// nothing", "line 1: there is nothing to draw"),
        ("seqdiag", "a ->\n;", "line 2: ';' stands here, expected the name of an actor"),
        ("seqdiag", "a ->", "line 1: the text ends here, expected the name of an actor"),
        ("seqdiag", "a -> b\n[label 3]", "line 2: '3' is not an attribute of an arrow"),
        ("seqdiag", "a -> b [lable = 'x'];", "line 1: 'lable' is not an attribute of an arrow; did you mean label?"),
        ("seqdiag", "\n\nedge_lenght = 3; a -> b", "line 3: 'edge_lenght' is not an attribute of a diagram; did"),
        ("seqdiag", "a -> b [label = ];", "line 1: ']' stands here, expected what label is"),
        ("seqdiag", 'a -> b\n[label = "x];', "line 2: a text in quotes never ends"),
        ("seqdiag", "a -> b /* x", "line 1: a comment never ends"),
        ("seqdiag", "a @ b", "line 1: '@' is not valid here"),
        ("seqdiag", "seqdiag { a -> b", "line 1: the text ends here, expected }"),
        ("seqdiag", "a -> b }", "line 1: '}' stands here, expected the end of the text"),
        ("seqdiag", "a -- b", "line 1: '--' stands here, expected one of -> <-"),
        ("blockdiag", "a --> b", "line 1: '-->' stands here, expected one of -> <- <-> --"),
        ("blockdiag", "a -> b; === x ===", "line 1: a block diagram has no dividers"),
        ("blockdiag", "a [shape = ellipsis]", "line 1: there is no shape 'ellipsis'; did you mean ellipse?"),
        ("blockdiag", "'' -> b", "line 1: an actor's name is empty or too long, expected 1 to 80 characters"),
        ("blockdiag", "group { a ", "line 1: the text ends here, expected the name of an actor"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_sentence_with_its_line(kind: DiagramKind, text: str, sentence: str) -> None:
    assert refusal(kind, text).startswith(sentence)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a" * (MAX_CHARACTERS + 1), "the text is too long"),
        ("; ".join(f"a{number}" for number in range(MAX_ACTORS + 1)), "there are too many actors"),
        ("a -> b; " * (MAX_STEPS + 1), "there are too many arrows"),
        ("a" + " -> b" * (MAX_STEPS + 1), "there are too many arrows"),
        ("a -> b {" * (MAX_DEPTH + 2), "braces are nested too deeply"),
        ("group {" * 2800, "braces are nested too deeply"),
        ("group { a } " * (MAX_GROUPS + 1), "there are too many groups"),
        ("/* " * 6000, "a comment never ends"),
        ("=== a=== == " * 1500, "'=' stands here"),
        ("[" * MAX_CHARACTERS, "'[' stands here"),
        ("a, " * 3000 + "a -> " + "b, " * 3000 + "b", "there are too many arrows"),
        ("a [" + "label = b " * 1900, "the text ends here"),
    ],
)
def test_hostile_texts_are_refused_at_their_limits(text: str, sentence: str) -> None:
    assert sentence in refusal("seqdiag", text)


PIECES = st.sampled_from(
    [*"{}[];,=\"'\\\n#/*-<>.", "->", "<-", "<->", "-->", "=>", "===", "...", "group", "seqdiag", "class", "loop", "a",
     "b", "label", "shape", "dir", "color", "return", "note", "autonumber", " ", "\u202e", "\ud800", "é"]
)  # fmt: skip


@given(st.sampled_from(["blockdiag", "seqdiag"]), st.lists(PIECES, max_size=60).map("".join) | st.text(max_size=60))
def test_any_text_is_a_diagram_within_the_limits_or_one_sentence(kind: DiagramKind, text: str) -> None:
    try:
        diagram = read_diagram(kind, text)
    except UsageError as error:
        match = re.fullmatch(r"line ([1-9]\d*): [^\n]+", str(error))
        assert match
        assert int(match[1]) <= text.count("\n") + 1
        return
    names = {actor.name for actor in diagram.actors}
    assert 1 <= len(names) == len(diagram.actors) <= MAX_ACTORS
    assert len(diagram.steps) <= MAX_STEPS
    assert all({arrow.source, arrow.target} <= names for arrow in diagram.arrows)
    assert all(set(group.members) <= names for group in diagram.groups)


LABELS = st.text(st.characters(codec="utf-8", exclude_categories=["Cc"]) | st.just("\n"), max_size=12)
NAMES = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Z"]), min_size=1, max_size=6)


@st.composite
def diagrams(draw: st.DrawFn) -> Diagram:
    names = draw(st.lists(NAMES, min_size=1, max_size=5, unique=True))
    actors = tuple(
        DiagramActor(name, draw(LABELS), draw(st.sampled_from(["box", "ellipse", "note"]))) for name in names
    )
    arrow = st.builds(
        DiagramArrow, st.sampled_from(names), st.sampled_from(names), LABELS, st.sampled_from(["solid", "dashed"]),
        failed=st.booleans(), colour=st.sampled_from(["", "red", "#123456"]), note=LABELS,
    )  # fmt: skip
    divider = st.builds(Divider, st.sampled_from(["", "later", "part 2"]), st.booleans())
    return Diagram("seqdiag", actors, tuple(draw(st.lists(arrow | divider, max_size=8))))


def quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def written(diagram: Diagram) -> str:
    lines = [f"{quoted(each.name)} [label = {quoted(each.label)}, shape = {each.shape}];" for each in diagram.actors]
    for step in diagram.steps:
        if isinstance(step, Divider):
            signs = "..." if step.delay else "==="
            lines.append(f"{signs} {step.text} {signs}")
            continue
        sign = "-->" if step.line == "dashed" else "->"
        attributes = [
            f"label = {quoted(step.label)}",
            f"note = {quoted(step.note)}",
            *(["failed"] if step.failed else []),
        ]
        attributes += [f"color = {quoted(step.colour)}"] if step.colour else []
        lines.append(f"{quoted(step.source)} {sign} {quoted(step.target)} [{', '.join(attributes)}];")
    return "\n".join(["seqdiag {", *lines, "}"])


@given(diagrams())
def test_a_diagram_that_is_written_down_is_read_again(diagram: Diagram) -> None:
    assert read_diagram("seqdiag", written(diagram)) == diagram


def test_the_course_notebook_draws_four() -> None:
    notebook_diagrams = read_diagrams(read_notebook(MESSAGING.read_bytes(), "messaging.ipynb").notebook)
    assert notebook_diagrams.problems == ()
    assert [(cell.cell, cell.diagram.kind) for cell in notebook_diagrams.cells] == [
        (2, "blockdiag"),
        (7, "seqdiag"),
        (15, "seqdiag"),
        (27, "seqdiag"),
    ]
    blocks, *_, last = (cell.diagram for cell in notebook_diagrams.cells)
    assert [actor.label for actor in blocks.actors] == ["Robot", "Python message\nhandler", "Neural network"]
    assert {arrow.heads for arrow in blocks.arrows} == {"both"}
    assert list_texts(last) == [
        "robot > responder: IMG_DATA::data",
        "responder > agent: message",
        "agent > parser: message",
        "parser > agent: object",
        "agent > MLP: object",
        "MLP > agent: classification",
        "agent > responder: response",
        "responder > logger: log message and response",
        "responder > robot: JSON::response",
    ]


def test_a_problem_names_the_cell_and_the_line_in_it() -> None:
    sources = ["x = 1", "# first\n\n%%seqdiag --size 3\na -> b\na @ b", "%%blockdiag\na -> b", "%%seqdiagram\nx"]
    cells = tuple(Cell(number, source) for number, source in enumerate(sources, 1))
    notebook_diagrams = read_diagrams(Notebook("n.ipynb", cells))
    assert [cell.cell for cell in notebook_diagrams.cells] == [3]
    assert len(notebook_diagrams.problems) == 1
    assert notebook_diagrams.problems[0].startswith("cell 2, line 5: '@' is not valid here")
    assert notebook_diagrams.problems[0].endswith("; the diagram is not drawn")
    assert read_diagrams(None).cells == ()


def test_diagrams_are_left_out_that_would_take_too_long_together() -> None:
    steps = "\n".join(f'a -> b [label="{"long " * 20}", note="{"note " * 20}"];' for _ in range(78))
    sources = [f"%%seqdiag\n{steps}"] * 20
    sources.insert(5, "%%seqdiag\na -> b")
    notebook_diagrams = read_diagrams(
        Notebook("n.ipynb", tuple(Cell(number, text) for number, text in enumerate(sources, 1)))
    )
    assert 80 <= sum(cell.diagram.parts for cell in notebook_diagrams.cells) <= MAX_PARTS
    assert [cell.cell for cell in notebook_diagrams.cells] == [1, 6]
    assert len(notebook_diagrams.problems) == MAX_DIAGRAMS - 2 + 1
    assert all("not drawn" in problem or "are drawn" in problem for problem in notebook_diagrams.problems)


def test_of_very_many_diagrams_the_first_are_read() -> None:
    cells = tuple(Cell(number, "%%seqdiag\na -> b") for number in range(1, 200))
    notebook_diagrams = read_diagrams(Notebook("n.ipynb", cells))
    assert len(notebook_diagrams.cells) == MAX_DIAGRAMS
    assert notebook_diagrams.problems == (
        f"cell {MAX_DIAGRAMS + 1}: of all diagrams only the first {MAX_DIAGRAMS} are drawn",
    )
