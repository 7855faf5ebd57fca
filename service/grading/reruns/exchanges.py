"""Exchanges: each replaces one ingredient of a trial and leaves all others as they were.

An exchange changes the specification of a trial. Exchanges with the same ``key`` give the same trial.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, Protocol

from responders.source_file import SourceFile
from responders.trial_spec import AgentSpec, EarlierAnswer, TrialSpec
from service.grading.run_plan import RunPlan
from sim.random_streams import RandomStream
from sim.recording import SECOND, Message, Pose, Recording
from submissions.submission import PART_FILES, SECOND_PROGRAM

RedrawnStream = Literal["light noise", "motor noise", "messages"]
ChannelEffect = Literal["duplication", "reordering", "corruption", "jitter"]
#: What a change does with its line: it changes the line, adds a statement or a wait after it, or removes it.
ChangeKind = Literal["changed", "added", "wait", "removed"]
#: A part of a submission: ``program``, ``responder``, ``second program``, or the name of an agent.
PartName = str
SECOND_PROGRAM_PART = "second program"
_FILES: Mapping[PartName, str] = MappingProxyType(
    {"program": PART_FILES["program"], "responder": PART_FILES["responder"], SECOND_PROGRAM_PART: SECOND_PROGRAM}
)


def get_part_file(part: PartName) -> str:
    """Return the name of a part's file, under which students know it."""
    return _FILES.get(part, f"{part}.py")


class Exchange(Protocol):
    """Replaces one ingredient of a trial."""

    @property
    def key(self) -> str:
        """A short text that identifies the exchange among those of a submission."""

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""


@dataclass(frozen=True, slots=True)
class WithoutLightNoise:
    """The light sensors have no noise."""

    key: str = "light noise off"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        return replace(spec, noise=replace(spec.noise, light=0.0))


@dataclass(frozen=True, slots=True)
class WithoutMotorNoise:
    """The wheels have no noise."""

    key: str = "motor noise off"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        return replace(spec, noise=replace(spec.noise, motor=0.0))


@dataclass(frozen=True, slots=True)
class RecordedLines:
    """Nothing is replaced, but the lines that the program reaches are recorded."""

    key: str = "lines recorded"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the same trial with its lines."""
        return replace(spec, records_lines=True)


@dataclass(frozen=True, slots=True)
class OtherNoise:
    """The noise of sensors and wheels has the same amplitude and another seed."""

    seed: int

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"noise of seed {self.seed}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        return replace(spec, noise_seed=self.seed)


@dataclass(frozen=True, slots=True)
class OtherDraw:
    """One random stream of each trial is drawn again, all others stay. ``number`` tells the draws of a stream apart."""

    stream: RedrawnStream
    number: int

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"draw {self.number} of {self.stream}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        seed = draw_other_seed(spec.seed, self.stream, self.number)
        noise_seed = spec.seed if spec.noise_seed is None else spec.noise_seed
        motor_seed = noise_seed if spec.motor_seed is None else spec.motor_seed
        match self.stream:
            case "light noise":
                return replace(spec, noise_seed=seed, motor_seed=motor_seed)
            case "motor noise":
                return replace(spec, motor_seed=seed)
            case "messages":
                return replace(spec, channel_seed=seed)


@dataclass(frozen=True, slots=True)
class OtherStart:
    """The jitter of each start pose is drawn again. ``starts`` has the poses of both robots by the trial's seed."""

    number: int
    starts: Mapping[int, tuple[Pose, Pose | None]] = field(repr=False, compare=False)

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"draw {self.number} of start pose"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        pose, second_pose = self.starts[spec.seed]
        partner = spec.partner
        if partner is not None and second_pose is not None:
            partner = replace(partner, pose=second_pose)
        return replace(spec, pose=pose, partner=partner)


@dataclass(frozen=True, slots=True)
class WithoutMessageLoss:
    """Chance loses no message; with ``numbers``, not these texts of the robot, from 1, nor their answers."""

    numbers: frozenset[int] | None = None

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return "no message lost" if self.numbers is None else f"messages {sorted(self.numbers)} not lost"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        if self.numbers is None:
            return replace(spec, channel=replace(spec.channel, loss=0.0))
        return replace(spec, never_lost=spec.never_lost | {number - 1 for number in self.numbers})


@dataclass(frozen=True, slots=True)
class WithoutChannelEffect:
    """The channel does not have this effect."""

    effect: ChannelEffect

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"no {self.effect}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        channel = spec.channel
        match self.effect:
            case "duplication":
                return replace(spec, channel=replace(channel, duplication=0.0))
            case "reordering":
                return replace(spec, channel=replace(channel, reordering=0.0))
            case "corruption":
                return replace(spec, channel=replace(channel, corruption=0.0))
            case "jitter":
                return replace(spec, channel=replace(channel, jitter=0.0))


@dataclass(frozen=True, slots=True)
class VisibleStart:
    """The robot starts from the pose of a visible trial. ``trial`` is that trial's index in the grade."""

    pose: Pose
    trial: int

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"start {self.pose.x:g}, {self.pose.y:g}, {self.pose.heading:g}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        return replace(spec, pose=self.pose)


@dataclass(frozen=True, slots=True)
class MoreTime:
    """The trial lasts ``factor`` times as long, in simulated time."""

    factor: float = 2.0

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"{self.factor:g} times as long"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        return replace(spec, seconds=spec.seconds * self.factor)


@dataclass(frozen=True, slots=True)
class GivenPart:
    """A part from another submission, such as the reference, replaces the student's. ``plan`` is that submission's."""

    part: PartName
    plan: RunPlan = field(repr=False, compare=False)

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"given {self.part}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        plan = self.plan.to_hidden_plan()
        if self.part == "program" and plan.program is not None:
            return replace(spec, program=plan.program, pen_down="p" in plan.flags.switches)
        if self.part == "responder" and plan.responder is not None:
            return replace(spec, responder=plan.responder, collaborative=True)
        if self.part == SECOND_PROGRAM_PART and plan.second_program is not None and spec.partner is not None:
            has_pen = "p" in plan.second_flags.switches
            return replace(spec, partner=replace(spec.partner, program=plan.second_program, pen_down=has_pen))
        if self.part in plan.agents:
            return replace(spec, agents={**spec.agents, self.part: plan.agents[self.part]})
        return spec


@dataclass(frozen=True, slots=True)
class AnswersFrom:
    """The responder of another submission answers from text ``number`` on, from 1; before, ``recording`` is repeated.

    It receives the earlier texts too, so that it knows what was said.
    """

    number: int
    plan: RunPlan = field(repr=False, compare=False)
    recording: Recording = field(repr=False, compare=False)

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"given answers from {self.number}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        spec = GivenPart("responder", self.plan).apply(spec)
        answers = collect_earlier_answers(self.recording, self.number)
        if spec.responder is None or answers is None:
            return spec
        return replace(spec, responder=replace(spec.responder, earlier_answers=answers))


@dataclass(frozen=True, slots=True)
class ChangedLine:
    """One change at a line of a part, whose file keeps its name: ``old`` became ``new``, and ``text`` is the result.

    ``direction`` is the sentence on a number that is too large or too small, if the change is of a number.
    """

    part: PartName
    line: int
    old: str
    new: str
    text: str = field(repr=False)
    kind: ChangeKind = "changed"
    direction: str = ""

    @property
    def file(self) -> str:
        """The name of the part's file."""
        return get_part_file(self.part)

    @property
    def key(self) -> str:
        """The text that identifies the exchange."""
        return f"{self.part} with the text {hashlib.sha256(self.text.encode('utf-8', 'surrogatepass')).hexdigest()}"

    def apply(self, spec: TrialSpec) -> TrialSpec:
        """Return the trial with the ingredient replaced."""
        if self.part == "program":
            return replace(spec, program=replace(spec.program, code=SourceFile(spec.program.code.name, self.text)))
        if self.part == "responder" and spec.responder is not None:
            code = SourceFile(spec.responder.code.name, self.text)
            return replace(spec, responder=replace(spec.responder, code=code))
        if self.part == SECOND_PROGRAM_PART and spec.partner is not None:
            program = spec.partner.program
            program = replace(program, code=SourceFile(program.code.name, self.text))
            return replace(spec, partner=replace(spec.partner, program=program))
        if self.part in spec.agents:
            agent = spec.agents[self.part]
            changed_agent: AgentSpec = replace(agent, code=SourceFile(agent.code.name, self.text))
            return replace(spec, agents={**spec.agents, self.part: changed_agent})
        return spec


def draw_other_seed(seed: int, stream: str, number: int) -> int:
    """Return the seed of another draw of a trial's random stream. Each trial and each stream has its own."""
    return RandomStream(seed, f"other {stream}").integer(number)


def apply_exchanges(spec: TrialSpec, exchanges: Sequence[Exchange]) -> TrialSpec:
    """Return the trial with all these ingredients replaced."""
    for exchange in exchanges:
        spec = exchange.apply(spec)
    return spec


def list_texts_and_answers(recording: Recording) -> list[tuple[Message, list[Message]]]:
    """Return the robot's texts in order, each with the answers to it, whether or not they arrived."""
    answers_by_text: dict[int, list[Message]] = {
        index: [] for index, message in enumerate(recording.messages) if message.sender == "robot"
    }
    for message in recording.messages:
        if message.sender == "responder" and message.reply_to in answers_by_text:
            answers_by_text[message.reply_to].append(message)
    return [(recording.messages[index], answers) for index, answers in answers_by_text.items()]


def collect_earlier_answers(recording: Recording, number: int) -> tuple[EarlierAnswer, ...] | None:
    """Return the recorded answers to the texts before text ``number``, from 1; None if copies make them ambiguous."""
    answers = []
    for text, replies in list_texts_and_answers(recording)[: number - 1]:
        if text.delivered is None:
            continue  # the responder was not called
        if text.note == "duplicated" or len(replies) > 1:
            return None
        if replies:
            slept = round((replies[0].t - text.t) * SECOND)
            answers.append(EarlierAnswer(replies[0].text, slept))
        else:
            answers.append(EarlierAnswer(None))
    return tuple(answers)
