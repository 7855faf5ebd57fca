"""The course notebook on messaging: each system behaves as the text describes, run from its own unchanged cells.

The systems, with the sections of the notebook that they come from:

1. a parser of messages (5.1.2)
2. an echo responder with a logger (5.1.2)
3. a JSON responder with an agent, which passes state (5.1.3)
4. an image parser, and the data of images (5.1.4)
5. an agent with a multi-layer perceptron (5.2.1)
6. a robot that acts on the agent's answer (5.2.1)
7. shapes at random places (5.2.1)
8. rules instead of the network (5.3)
9. a block diagram of the architecture (5.1.1)
10. sequence diagrams of the protocol (5.1.2, 5.1.3, 5.1.5)
11. messages that get lost out of range or facing the wrong way (5.1)
12. a convolutional network instead of the perceptron (5)

The notebook describes the last two only in words, without a program. The tests have the numbers of the systems.
"""

from __future__ import annotations

import pytest

from models import load_weights
from notebook_builder import MESSAGING
from responders import library
from responders.channel import Channel
from responders.notebook_executor import ExecutedNotebook
from running import run_program
from service.grading.standalone_runs import RunOptions, run_notebook
from service.grading.trial_runner import TrialRunner
from service.reports.plots.diagram_differences import compare_with_recording, describe_differences
from service.reports.plots.diagram_drawing import draw_diagram
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.message_counts import count_messages
from sim.recording import LossReason, Pose, Recording, Verdict
from submissions.assignment.examples import locate_examples
from submissions.diagram import Diagram
from submissions.diagram_cells import read_diagrams
from submissions.magics import split_program
from submissions.notebook import read_notebook
from submissions.simulator_page import apply_flags

NETWORK = {"mlp_shapes_14x14.joblib": load_weights("shapes")}
SHAPES = (
    "square",
    "right facing triangle",
    "left facing triangle",
    "downwards facing triangle",
    "upwards facing triangle",
    "diamond",
)
NOTEBOOK = read_notebook(MESSAGING.read_bytes(), MESSAGING.name).notebook
DIAGRAMS = {cell.cell: cell.diagram for cell in read_diagrams(NOTEBOOK).cells}


@pytest.fixture(scope="module")
def executed(runner: TrialRunner) -> ExecutedNotebook:
    """Execute the whole notebook from top to bottom."""
    return run_notebook(NOTEBOOK, NETWORK, RunOptions(), runner)


def run(executed: ExecutedNotebook, cell: int) -> Recording:
    """Return the run that a cell starts."""
    (recording,) = (each.recording for each in executed.runs if each.cell == cell)
    assert recording.verdict is Verdict.FINISHED
    return recording


def texts(recording: Recording, sender: str) -> list[str]:
    return [message.text for message in recording.messages if message.sender == sender]


def calls(recording: Recording) -> list[tuple[str, str]]:
    return [(call.caller, call.callee) for call in recording.calls]


def compared(diagram: Diagram, recording: Recording) -> str:
    comparison = compare_with_recording(diagram, count_messages(recording))
    assert comparison is not None
    return describe_differences(comparison)


def driven(runner: TrialRunner, start: Pose, responder: str = "") -> Recording:
    """Run the last program of the notebook from another start, with its own responder or another one."""
    folder = locate_examples("shape-recognition") / "seed"
    flags, text = split_program((folder / "robot.py").read_text())
    return run_program(
        runner,
        text,
        start,
        background=apply_flags(flags).background,
        responder=responder or (folder / "responder.py").read_text(),
        files=NETWORK,
    )


def test_it_runs_from_top_to_bottom(executed: ExecutedNotebook) -> None:
    assert (executed.raised, executed.stopped, executed.notes) == ((), None, ())
    assert [each.cell for each in executed.runs] == [12, 20, 25, 31, 32, 33, 34]


def test_1_parser(executed: ExecutedNotebook) -> None:
    assert (
        """
Original: PY::[1, 2, 3]
Parsed: [1, 2, 3]
Type: <class 'list'>

Original: PY:: {'int': 1, 'str': 'string'}
Parsed: {'int': 1, 'str': 'string'}
Type: <class 'dict'>

Original: PY::my message
Parsed: my message
Type: <class 'str'>

Original: my message
"""
        in executed.output
    )


def test_2_echo_and_logger(executed: ExecutedNotebook) -> None:
    recording = run(executed, 12)
    assert [(message.sender, message.text) for message in recording.messages] == [
        line
        for number in (0, 2, 4)
        for line in (("robot", f"PY::{number}"), ("responder", f"Python saw >> {number} << that..."))
    ]
    assert [line.text for line in recording.spoken] == ["all done"]
    assert calls(recording) == [("responder", "parser"), ("responder", "logger")] * 3
    output = executed.output.split("--- cell 13 ---\n")[1].split("--- cell")[0]
    assert output.startswith("# Responder logfile\n# -----------------\nReceived message: 0\n")
    assert output.count("---\n") == 3 + 1


def test_3_state_is_passed_by_agent_and_json(executed: ExecutedNotebook) -> None:
    recording = run(executed, 20)
    queues = [line.text for line in recording.printed if line.text.startswith("Message queue")]
    assert [queue.count("Py saw") for queue in queues] == [0, 1, 1, 2, 2, 3]
    assert texts(recording, "responder")[0] == 'JSON::{"message": "Py saw: 0"}'
    assert recording.spoken[-1].text == "Last Python message was ...Py saw: 4"
    assert calls(recording) == [("responder", "parser"), ("responder", "agent"), ("responder", "logger")] * 3
    assert 'Response: JSON::{"message": "Py saw: [1, 2, 3]"}' in executed.output


def test_4_image_parser_and_image_data(executed: ExecutedNotebook) -> None:
    assert "Parsed: {'typ': 'IMG_DATA', 'obj': {'k1': [1, 2, 3], 'k2': [4, 5, 6]}}" in executed.output
    recording = run(executed, 25)
    answers = texts(recording, "responder")
    assert answers[0] == """JSON::{"message": "Py saw: {'typ': 'PY', 'obj': {'test_key': 'test value'}}"}"""
    assert answers[1].startswith("""JSON::{"message": "Py saw: {'typ': 'IMG_DATA', 'obj': {'left': '245,226,225,255,""")
    assert len(recording.images) == 1


def test_5_network_in_the_agent(executed: ExecutedNotebook) -> None:
    saw = 'JSON::{"message": {"report": "Agent says: I saw %s", "shape": "%s"}}'
    assert texts(run(executed, 31), "responder") == [saw % (("upwards facing triangle",) * 2)]
    assert texts(run(executed, 32), "responder") == [saw % (("square",) * 2)]
    assert calls(run(executed, 31)) == [
        ("responder", "parser"),
        ("agent", "MLP"),
        ("responder", "agent"),
        ("responder", "logger"),
    ]


def test_6_the_robot_acts_on_the_answer(executed: ExecutedNotebook) -> None:
    assert [line.text for line in run(executed, 33).spoken] == ["Is that a upwards facing triangle"]


@pytest.mark.parametrize(("number", "shape"), list(enumerate(SHAPES)))
def test_7_every_shape_that_chance_may_choose(runner: TrialRunner, number: int, shape: str) -> None:
    recording = driven(runner, Pose(200 + 80 * number, 900, 0))
    assert recording.spoken[-1].text == f"Is that a {shape}"
    assert recording.images[0].truth == shape


def test_8_rules_in_place_of_the_network(runner: TrialRunner) -> None:
    recording = driven(runner, Pose(520, 900, 0), library.source("rule_responder.py"))
    assert recording.spoken[-1].text == "Is that a upwards facing triangle"
    assert ("agent", "MLP") not in calls(recording)


def test_9_block_diagram(executed: ExecutedNotebook) -> None:
    blocks = DIAGRAMS[2]
    assert [actor.label for actor in blocks.actors] == ["Robot", "Python message\nhandler", "Neural network"]
    assert [(arrow.source, arrow.target, arrow.heads) for arrow in blocks.arrows] == [
        ("robot", "python", "both"),
        ("python", "mlp", "both"),
    ]
    assert compared(blocks, run(executed, 33)) == "parser, agent and logger took part and are not drawn."
    draw_diagram(blocks, "Cell 2", "", Highlights()).draw_without_rendering()


@pytest.mark.parametrize(
    ("cell", "described", "words"),
    [
        (7, 12, "The diagram matches the events."),
        # In the text the agent calls the parser. In the program, the parser's result is passed to the agent.
        (15, 20, "agent → parser and parser → agent did not happen. responder → parser happened and is not drawn."),
        (27, 33, "agent → parser and parser → agent did not happen. responder → parser happened and is not drawn."),
    ],
)
def test_10_sequence_diagrams(executed: ExecutedNotebook, cell: int, described: int, words: str) -> None:
    assert compared(DIAGRAMS[cell], run(executed, described)) == words
    draw_diagram(DIAGRAMS[cell], f"Cell {cell}", "", Highlights()).draw_without_rendering()


@pytest.mark.parametrize(
    ("start", "lost"),
    [
        (Pose(1200, 300, 0), ""),
        (Pose(700, 300, 0), "out of range"),
        (Pose(1200, 300, 180), "facing away"),
    ],
)
def test_11_messages_are_lost_out_of_range_or_facing_the_wrong_way(
    runner: TrialRunner, start: Pose, lost: LossReason
) -> None:
    """The echo's own program and responder, over an infrared link to a beacon at (1500, 300)."""
    folder = locate_examples("echo-responder") / "seed"
    _, text = split_program((folder / "robot.py").read_text())
    channel = Channel(link="infrared", beacon=(1500, 300), range=600, facing=90)
    recording = run_program(
        runner, text, start, responder=(folder / "responder.py").read_text(), channel=channel, seconds=20
    )
    assert [message.lost for message in recording.messages if message.sender == "robot"] == [lost] * 3
    assert len(texts(recording, "responder")) == (0 if lost else 3)
    assert recording.spoken[-1].text == "all done"


def test_12_a_convolutional_network_in_place_of_the_perceptron(runner: TrialRunner) -> None:
    """The image parser's own message, classified by both kinds of network."""
    folder = locate_examples("mlp-against-cnn") / "reference"
    networks = {
        "mlp_digits_14x14.joblib": load_weights("digits"),
        "cnn_digits_14x14.onnx": load_weights("digits-cnn"),
    }
    recording = run_program(
        runner,
        (folder / "robot.py").read_text(),
        Pose(700, 1050, 90),
        background="MNIST_Digits",
        responder=(folder / "responder.py").read_text(),
        files=networks,
    )
    digit = recording.images[0].truth
    assert [line.text for line in recording.spoken] == [f"The MLP reads {digit}, the CNN {digit}"]
