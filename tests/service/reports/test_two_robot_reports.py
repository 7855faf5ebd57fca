"""Grades of two robots in the store, in traces and in reports: each fact appears once, with its robot."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from service.grading.grade import Grade
from service.grading.grader import grade
from service.grading.trial_runner import TrialRunner
from service.reports.faults import group_faults
from service.reports.formats.json_output import build_json_document
from service.reports.page import build_page
from service.reports.plots.grade_plots import draw_all_plots, list_plots
from service.reports.plots.sequence import Step, build_conversation
from service.reports.trace import build_trace
from service.reports.view import build_staff_view
from service.store.grades.recordings import encode_within_limit, from_bytes, to_bytes
from sim.recording import Recording, Verdict
from submissions.assignment.examples import read_example
from submissions.assignment.reader import find_assignment


def graded(assignment: str, example: str, runner: TrialRunner) -> Grade:
    return grade(read_example(assignment, example), find_assignment(assignment), runner=runner)


@pytest.fixture(scope="module")
def relayed(runner: TrialRunner) -> Grade:
    return graded("relay-a-message", "reference", runner)


@pytest.fixture(scope="module")
def crashed(runner: TrialRunner) -> Grade:
    return graded("meet-at-the-shape", "looks-too-soon", runner)


def partner_of(recording: Recording) -> Recording:
    assert recording.partner is not None
    return recording.partner


def test_a_stored_recording_has_its_partner(relayed: Grade) -> None:
    recording = relayed.trials[0].recording
    back = from_bytes(to_bytes(recording))
    assert to_bytes(back) == to_bytes(recording)
    assert partner_of(back).ticks.x.tolist() == partner_of(recording).ticks.x.tolist()
    assert partner_of(back).messages == partner_of(recording).messages
    assert from_bytes(to_bytes(replace(recording, partner=None))).partner is None


def test_what_is_too_large_of_either_is_cut(relayed: Grade) -> None:
    kept = encode_within_limit(relayed.trials[0].recording, 2500)
    assert len(kept.data) <= 2500
    assert all("too large" in each.notes[-1] for each in (kept.recording, partner_of(kept.recording)))


def test_traces_and_json_have_both(relayed: Grade) -> None:
    recording = relayed.trials[0].recording
    trace = build_trace(recording)
    assert trace["partner"]["spoken"] == [[line.t, line.text] for line in partner_of(recording).spoken]
    document = json.loads(json.dumps(build_json_document(build_staff_view(relayed))))
    assert document["trials"][0]["partner"]["spoken"] == ["I see grey"]
    assert document["trials"][0]["spoken"] == []


def test_the_diagram_has_a_lane_for_each_and_every_text_once(relayed: Grade, crashed: Grade) -> None:
    conversation = build_conversation(relayed.trials[0].recording, max_exchanges=50)
    assert conversation.parties == ("robot", "responder", "robot 2")
    arrows = [(step.source, step.target) for step in conversation.steps if isinstance(step, Step)]
    assert arrows.count(("robot", "responder")) == arrows.count(("responder", "robot")) == 1
    assert arrows.count(("robot 2", "responder")) == arrows.count(("responder", "robot 2")) == 4
    linked = build_conversation(crashed.trials[0].recording)
    assert linked.parties == ("robot", "robot 2")
    assert [(step.kind, step.source, step.target) for step in linked.steps if isinstance(step, Step)] == [
        ("lost", "robot", "robot 2")
    ]


def test_a_fault_of_the_second_program_is_called_so(crashed: Grade) -> None:
    assert crashed.verdict is Verdict.PROGRAM_ERROR
    (group,) = group_faults(crashed)
    assert group.where == "Program of the second robot, line 10"
    (scene,) = build_page(build_staff_view(crashed)).scenes
    assert [entry.text for entry in scene.timeline if entry.kind == "fault"] == [
        "robot 2: IndexError: list index out of range"
    ]
    assert [message.sender for message in scene.messages] == ["robot"]


def _second_on_its_way(recording: Recording) -> Recording:
    """Return a recording where the second robot has moved a little. In this assignment both stand still."""
    partner = recording.partner
    assert partner is not None
    return replace(recording, partner=replace(partner, ticks=replace(partner.ticks, x=partner.ticks.x + 1.0)))


def test_plots_are_drawn_and_name_both(relayed: Grade) -> None:
    moved = tuple(replace(trial, recording=_second_on_its_way(trial.recording)) for trial in relayed.trials)
    for pair, kinds in (
        (relayed, set()),
        (replace(relayed, trials=moved), {"path", "sensors"}),
    ):
        descriptions = {plot.kind: plot.alt for plot in list_plots(pair)}
        assert descriptions.keys() == kinds
        assert draw_all_plots(pair).keys() == {plot.name for plot in list_plots(pair)}
    assert "Path of the second robot from (2000, 200) mm to (2000, 200) mm." in descriptions["path"]
    talk = build_page(build_staff_view(relayed)).scenes[0].talk
    assert "robot to responder 1, responder to robot 1, robot 2 to responder 4, responder to robot 2 4." in talk
