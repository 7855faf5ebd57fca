"""What happened in one trial, tick by tick and word by word, and how it ended.

A recording is plain data: it knows neither students nor marks, and nothing in it is read back into a simulation. Who
reads no ticks need not wait for numpy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, TypeAlias

from sim.columns import Panel, column, columns_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Floats: TypeAlias = "NDArray[np.float64]"
Integers: TypeAlias = "NDArray[np.int64]"

#: Units of simulated time in a second: a third of a microsecond, so that a tick and 10 ms are both whole.
SECOND = 3_000_000
TICK = SECOND // 30
#: A tick in the original's browser, whose timer leaves out what is less than a millisecond.
BROWSER_TICK = SECOND // 1000 * 33
MILLISECOND = SECOND // 1000
#: Pixels that a light sensor of 20 mm sees (robolab: rows and columns with (r-10)**2 + (c-10)**2 < 100).
SENSOR_SIDE = 20


class Verdict(StrEnum):
    """How a trial ended and whose fault it was."""

    FINISHED = "finished"
    PROGRAM_ERROR = "program_error"
    RESPONDER_ERROR = "responder_error"
    PROTOCOL_ERROR = "protocol_error"
    TIME_LIMIT = "time_limit"
    CPU_LIMIT = "cpu_limit"
    MEMORY_LIMIT = "memory_limit"
    OUTPUT_LIMIT = "output_limit"
    STALLED = "stalled"
    SANDBOX_VIOLATION = "sandbox_violation"
    ASSIGNMENT_ERROR = "assignment_error"
    HOST_ERROR = "host_error"


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the robot is: mm from the lower left corner, degrees anticlockwise from +x."""

    x: float
    y: float
    heading: float


_LIGHT = Panel("Reflected light, red 0–255", height=1.25, limits=(-10, 265), marks=(0, 64, 128, 192, 255))
_DISTANCE = Panel("Ultrasonic, cm", limits=(-12, 267), marks=(0, 100, 200), per=10)
_GYRO = Panel("Gyro, degrees clockwise")
_WHEELS = Panel("Wheel encoders, degrees", height=0.75, rank=1)


@dataclass(frozen=True, slots=True)
class Ticks:
    """One row a tick; row i is the state after tick i+1. All arrays have n rows.

    A column that is not given is not known. This is the table of columns: what the chain packs, what a program can
    read, what the store keeps, what traces and plots show is taken from here.
    """

    x: Floats = column("mm", "drive.x")
    y: Floats = column("mm", "drive.y")
    heading: Floats = column("degrees, unwrapped", "drive.heading_degrees")
    left_position: Floats = column("encoder degrees", "drive.left.position", panel=_WHEELS, label="left")
    right_position: Floats = column("encoder degrees", "drive.right.position", panel=_WHEELS, label="right")
    left_sums: Integers = column(
        "R, G, B summed over the sensor's pixels",
        "left_sums",
        width=3,
        whole=True,
        told_as="left_rgb",
        sensor="left",
        reading="left_means",
        panel=_LIGHT,
        label="left",
    )
    right_sums: Integers = column(
        "R, G, B summed over the sensor's pixels",
        "right_sums",
        width=3,
        whole=True,
        told_as="right_rgb",
        sensor="right",
        reading="right_means",
        panel=_LIGHT,
        label="right",
    )
    ultrasonic: Floats = column("mm", "ultrasonic", sensor="ultrasonic", panel=_DISTANCE, label="distance")
    gyro: Floats = column(
        "degrees, clockwise",
        "drive.gyro_angle",
        sensor="gyro",
        reading="gyro_angle_and_rate",
        panel=_GYRO,
        label="angle",
    )
    left_pixels: int = 305  # how many pixels the sums are over
    right_pixels: int = 305
    length: int = TICK  # of a tick, units of simulated time

    def __post_init__(self) -> None:
        for each in COLUMNS:
            if getattr(self, each.name) is None:
                object.__setattr__(self, each.name, each.unknown(len(self.x)))

    def __len__(self) -> int:
        return len(self.x)

    def told(self) -> dict[str, Floats]:
        """What readers of a recording are told of it, seconds first; every array has n rows."""
        return {"t": self.t, **{each.told_as: getattr(self, each.told_as) for each in COLUMNS}}

    @property
    def t(self) -> Floats:
        """Seconds, shape (n,)."""
        import numpy as np

        return np.arange(1, len(self.x) + 1) * self.length / SECOND

    @property
    def per_second(self) -> float:
        """How many there are in a second."""
        return SECOND / self.length

    @property
    def left_rgb(self) -> Floats:
        """Mean R, G, B of the left light sensor, 0..255, shape (n, 3)."""
        return self.left_sums / self.left_pixels

    @property
    def right_rgb(self) -> Floats:
        """Mean R, G, B of the right light sensor, 0..255, shape (n, 3)."""
        return self.right_sums / self.right_pixels


#: In the order of the chain's rows.
COLUMNS = columns_of(Ticks)
#: What a program can read: each sensor, and the path from the world to what it gives.
SENSORS: Mapping[str, str] = MappingProxyType({each.sensor: each.reading for each in COLUMNS if each.sensor})


@dataclass(frozen=True, slots=True)
class Line:
    """Something printed or spoken, and when (seconds)."""

    t: float
    text: str


#: Where there is no responder the simulator answers each text with itself, after this.
STAND_IN = "pingpong "
#: Why the channel lost a text; empty where it did not.
LossReason = Literal["", "chance", "out of range", "facing away", "blocked"]


@dataclass(frozen=True, slots=True)
class Message:
    """One text that crossed the bridge.

    ``t`` is when it was sent; ``delivered`` when it arrived, None if it never did. ``reply_to`` is the index, in
    the recording's messages, of the text that it answers. ``note`` says what befell it: lost, duplicated, malformed.
    ``distance`` (mm) and ``angle`` (degrees, to the left above 0) are from the robot to the other end of an infrared
    link when the text set out or, of an answer, when it came or was lost.
    """

    t: float
    sender: Literal["robot", "responder", "partner"]  # the partner is the other robot, where there are two
    text: str
    delivered: float | None
    reply_to: int | None = None
    note: str = ""
    lost: LossReason = ""  # recordings of earlier releases say so in their note alone
    distance: float | None = None
    angle: float | None = None
    arrived_as: str | None = None  # where the channel corrupted it
    to_partner: bool = False  # whether a robot's text went to the other robot, and to no responder

    @property
    def received(self) -> str:
        """The text as it arrived, if it did."""
        return self.text if self.arrived_as is None else self.arrived_as


@dataclass(frozen=True, slots=True)
class AgentMessage:
    """One text between the responder and an agent, or between two agents, while the robot's message was answered.

    ``message`` is the index of that one, -1 while the responder was loaded. ``reply_to`` is the index, in the
    recording's agent messages, of what it answers; ``note`` says of a question why it got no answer.
    """

    t: float
    sender: str
    receiver: str
    text: str  # what was sent, if it was a text; else as JSON has it
    message: int
    reply_to: int | None = None
    note: str = ""
    is_text: bool = True


@dataclass(frozen=True, slots=True)
class AgentOutput:
    """What an agent printed, and what it wrote to its logger.txt."""

    agent: str
    printed: str
    log: str


@dataclass(frozen=True, slots=True)
class Image:
    """What both light sensors saw when the program printed IMG_DATA, and where the robot was.

    ``left`` and ``right`` are the raw RGBA bytes of side x side pixels, row-major, top row first;
    ``message`` is the index of the message that carried it.
    """

    t: float
    tick: int
    pose: Pose
    left: bytes
    right: bytes
    message: int
    truth: str | None = None  # what the floor has under the left sensor, where it has a label
    side: int = SENSOR_SIDE


@dataclass(frozen=True, slots=True)
class Call:
    """A call inside the responder (parser, agent, logger, predict), for the sequence diagram; never marked."""

    message: int  # index of the message being answered
    depth: int
    caller: str  # responder, agent ...
    callee: str  # parser, agent, logger, or the name bound to a network
    argument: str  # shortened repr
    result: str  # shortened repr
    before: int = 0  # how many agent messages there were when it ended


@dataclass(frozen=True, slots=True)
class Datum:
    """One datalog line: ``Light_left: 42 1.5`` has name Light_left, value 42.0, simtime 1.5."""

    t: float
    name: str
    value: float
    simtime: float | None


@dataclass(frozen=True, slots=True)
class Touch:
    """The robot's body began to touch a wall or an obstacle."""

    t: float
    what: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that went wrong: when, whose, one sentence, and the line of the student's file if there is one.

    In a notebook the line is that of a cell, both counted from 1; with a ``file`` it is that of a file beside.
    """

    t: float
    verdict: Verdict
    who: Literal["program", "second program", "responder", "bridge", "host", "assignment"]
    message: str
    line: int | None = None
    hint: str = ""
    cell: int | None = None
    staff: str = ""  # what our own code stumbled over, for staff to look at
    agent: str = ""  # which agent of the responder's it was, if not the responder itself
    file: str = ""  # the Python file beside the program, responder or notebook that the line is in

    @property
    def place(self) -> str:
        """``line 3``, ``cell 7, line 3``, ``parser, line 3`` or ``line 3 of helper.py``; empty where none is known."""
        within = [self.agent] if self.agent else []
        within += [f"cell {self.cell}"] if self.cell is not None else []
        beside = f" of {self.file}" if self.file else ""
        return ", ".join(within + ([f"line {self.line}{beside}"] if self.line is not None else []))


@dataclass(frozen=True, slots=True)
class Recording:
    """All that happened in a trial. ``sha256`` is the chain over every tick, value, print and message.

    Of two robots each has a recording: this is the first one's, with the second's as its ``partner``. What is in it is
    its own robot's, but for ``sha256``, which is over both, and what the responder printed and logged.
    """

    background: str
    start: Pose
    end: Pose
    end_t: float
    ticks: Ticks
    verdict: Verdict
    sha256: str
    printed: tuple[Line, ...] = ()
    spoken: tuple[Line, ...] = ()
    messages: tuple[Message, ...] = ()
    images: tuple[Image, ...] = ()
    calls: tuple[Call, ...] = ()
    datalog: tuple[Datum, ...] = ()
    image_log: tuple[tuple[str, str, int], ...] = ()  # side, csv, tick: what ``image_data left|right|both`` collects
    touches: tuple[Touch, ...] = ()
    faults: tuple[Fault, ...] = ()
    obstacles: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height
    beacon: tuple[float, float] | None = None  # the other end of an infrared link
    label_patches: bool = True  # whether the floor showed its grey label patches
    sheet: int = 0  # the seed of the digits on it, for a digit sheet
    robot: str = "Default_Robot"
    pen: tuple[tuple[int, bool], ...] = ()  # (tick, down) whenever the pen changes
    responder_output: str = ""
    responder_log: str = ""  # what the responder wrote to logger.txt
    sandbox: str = "process limits only"
    notes: tuple[str, ...] = field(default=())
    agent_messages: tuple[AgentMessage, ...] = ()
    agent_outputs: tuple[AgentOutput, ...] = ()  # of every agent, in the assignment's order
    partner: Recording | None = None
    cell_errors: tuple[Fault, ...] = ()  # of a notebook: the first cells that failed, whatever came of it
