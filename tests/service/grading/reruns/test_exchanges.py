"""Exchanges replace one ingredient of a trial, and nothing else."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from judging import recorded, talk
from responders.channel import Channel, TrialChannel
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from responders.trial_spec import EarlierAnswer, ProgramSpec, ResponderSpec, TrialSpec
from service.grading.reruns.exchanges import (
    ChangedLine,
    Exchange,
    MoreTime,
    OtherDraw,
    OtherNoise,
    OtherStart,
    VisibleStart,
    WithoutChannelEffect,
    WithoutLightNoise,
    WithoutMessageLoss,
    WithoutMotorNoise,
    collect_earlier_answers,
)
from service.grading.reruns.halves import find_first_difference
from service.grading.reruns.mildest import Conditions, ScaledConditions
from sim.floors import build_floor
from sim.recording import Message, Pose
from sim.robot import get_robot
from sim.world import Noise

pytestmark = pytest.mark.fast

LIMITS = ChildLimits(1.0, 64 << 20)
SPEC = TrialSpec(
    program=ProgramSpec(SourceFile("robot.py", "say('a')"), "preloaded", LIMITS, 1000),
    responder=ResponderSpec(SourceFile("responder.py", "def responder(text): pass"), {}, LIMITS, 1000),
    collaborative=True,
    floor=build_floor("Empty_Map"),
    robot=get_robot("Default_Robot"),
    pose=Pose(100, 800, 0),
    noise=Noise(8, 20),
    channel=Channel(loss=0.4, duplication=0.2, reordering=0.3, corruption=0.1, jitter=0.5),
    seconds=20,
    seed=1,
    child_seed=2,
)


@pytest.mark.parametrize(
    ("exchange", "field"),
    [
        (WithoutLightNoise(), "noise"),
        (WithoutMotorNoise(), "noise"),
        (OtherNoise(7), "noise_seed"),
        (OtherDraw("motor noise", 1), "motor_seed"),
        (OtherDraw("messages", 1), "channel_seed"),
        (OtherStart(1, {1: (Pose(1, 2, 3), None)}), "pose"),
        (WithoutMessageLoss(), "channel"),
        (WithoutMessageLoss(frozenset({3})), "never_lost"),
        (WithoutChannelEffect("corruption"), "channel"),
        (VisibleStart(Pose(1, 2, 3), 0), "pose"),
        (MoreTime(), "seconds"),
        (ChangedLine("program", 1, "a", "b", "say('b')"), "program"),
        (ChangedLine("responder", 1, "", "", "x = 1"), "responder"),
    ],
    ids=lambda each: getattr(each, "key", each),
)
def test_one_field_changes(exchange: Exchange, field: str) -> None:
    changed = exchange.apply(SPEC)
    assert [each.name for each in fields(TrialSpec) if getattr(changed, each.name) != getattr(SPEC, each.name)] == [
        field
    ]


def test_one_noise_is_off_and_the_other_stays() -> None:
    assert WithoutLightNoise().apply(SPEC).noise == Noise(0, 20)
    assert WithoutMotorNoise().apply(SPEC).noise == Noise(8, 0)


def test_scaled_conditions_are_between_both_ends() -> None:
    easy, hard = Conditions(0, 0, 0, Pose(500, 800, 90)), Conditions(8, 20, 0.4, SPEC.pose)
    middle = ScaledConditions(0.5, easy, hard).apply(SPEC)
    assert (middle.noise, middle.channel.loss, middle.pose) == (Noise(4, 10), 0.2, Pose(300, 800, 45))
    assert ScaledConditions(1, easy, hard).apply(SPEC) == SPEC


def test_other_light_noise_keeps_the_wheels_noise_and_other_streams_are_kept_too() -> None:
    light = OtherDraw("light noise", 1)
    assert light.apply(SPEC).motor_seed == SPEC.seed
    assert light.apply(SPEC).noise_seed not in (None, SPEC.seed)
    both = OtherDraw("motor noise", 1).apply(light.apply(SPEC))
    assert both.noise_seed == light.apply(SPEC).noise_seed
    assert both.motor_seed not in (SPEC.seed, both.noise_seed)
    assert OtherDraw("light noise", 2).apply(SPEC).noise_seed != light.apply(SPEC).noise_seed


def test_named_messages_are_not_lost_and_all_other_draws_stay() -> None:
    channel, never_lost = Channel(loss=0.4), WithoutMessageLoss(frozenset({3, 5})).apply(SPEC).never_lost
    before = [TrialChannel(channel, 1).count_copies(number) for number in range(20)]
    after = [TrialChannel(channel, 1, never_lost).count_copies(number) for number in range(20)]
    assert 0 in before
    assert after == [1 if number in (2, 4) else copies for number, copies in enumerate(before)]


def test_earlier_answers_are_those_before_the_number_that_reached_the_responder() -> None:
    messages = talk(("PY::1", "one"), ("PY::2", None), ("PY::3", "three"))
    lost = Message(9.0, "robot", "PY::4", None, lost="chance")
    recording = recorded(messages=(*messages, lost))
    assert collect_earlier_answers(recording, 1) == ()
    assert collect_earlier_answers(recording, 5) == (
        EarlierAnswer("one"),
        EarlierAnswer(None),
        EarlierAnswer("three"),
    )
    doubled = replace(messages[0], note="duplicated")
    assert collect_earlier_answers(recorded(messages=(doubled, *messages[1:])), 3) is None


@pytest.mark.parametrize(
    ("own", "other", "number"),
    [
        ((("a", "1"), ("b", "2")), (("a", "1"), ("b", "2")), None),
        ((("a", "1"), ("b", "2")), (("a", "1"), ("b", "3")), 2),
        ((("a", "1"), ("b", None)), (("a", "1"), ("b", "2")), 2),
        ((("a", "1"),), (("x", "2"),), None),
        ((("a", 'JSON::{"x": 1, "y": 2}'),), (("a", 'JSON::{"y":2,"x":1}'),), None),
        ((("a", 'JSON::{"x": 1'),), (("a", 'JSON::{"x":1'),), 1),
    ],
)
def test_first_difference_is_of_answers_to_the_same_texts(
    own: tuple[tuple[str, str | None], ...], other: tuple[tuple[str, str | None], ...], number: int | None
) -> None:
    recordings = recorded(messages=talk(*own)), recorded(messages=talk(*other))
    assert find_first_difference(*recordings) == number
