"""Recording of a trial: every tick, message, print and fault, and the verdict.

Recordings are plain data without students or marks. They are never read back into a simulation. Readers that need no
ticks can import this module without numpy.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, overload

from sim.columns import Panel, collect_columns, column

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


Floats: TypeAlias = "NDArray[np.float64]"
Integers: TypeAlias = "NDArray[np.int64]"

#: Units of simulated time per second. A unit is a third of a microsecond, so that a tick and 10 ms are integers.
SECOND = 3_000_000
TICK = SECOND // 30
#: Tick length in the original's browser, whose timer truncates to whole milliseconds.
BROWSER_TICK = SECOND // 1000 * 33
MILLISECOND = SECOND // 1000
#: Pixels that a light sensor of 20 mm sees (robolab: rows and columns with (r-10)**2 + (c-10)**2 < 100).
SENSOR_SIDE = 20
#: Memory of one line in a trace: a float and two integers.
LINE_BYTES = 16


class Verdict(StrEnum):
    """Verdict of a trial: how it ended and who caused it."""

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
    """Pose of the robot: mm from the lower left corner, degrees anticlockwise from +x."""

    x: float
    y: float
    heading: float


_LIGHT = Panel("Reflected light, red 0–255", height=1.25, limits=(-10, 265), marks=(0, 64, 128, 192, 255))
_DISTANCE = Panel("Ultrasonic, cm", limits=(-12, 267), marks=(0, 100, 200), per=10)
_GYRO = Panel("Gyro, degrees clockwise")
_WHEELS = Panel("Wheel encoders, degrees", height=0.75, rank=1)


@dataclass(frozen=True, slots=True)
class Ticks:
    """One row per tick; row i is the state after tick i+1. All arrays have n rows.

    Missing columns have unknown values. The fields of this class define the columns for the hash chain, the sensors,
    the store, traces and plots.
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
        display_attribute="left_rgb",
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
        display_attribute="right_rgb",
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
    length: int = TICK  # of a tick, in units of simulated time

    def __post_init__(self) -> None:
        for column_info in COLUMNS:
            if getattr(self, column_info.name) is None:
                object.__setattr__(self, column_info.name, column_info.build_unknown_values(len(self.x)))

    def __len__(self) -> int:
        return len(self.x)

    def to_displayed_columns(self) -> dict[str, Floats]:
        """Return the columns as readers see them, seconds first; every array has n rows."""
        return {"t": self.t, **{each.display_attribute: getattr(self, each.display_attribute) for each in COLUMNS}}

    @property
    def t(self) -> Floats:
        """Seconds, shape (n,)."""
        import numpy as np

        return np.arange(1, len(self.x) + 1) * self.length / SECOND

    @property
    def per_second(self) -> float:
        """The number of ticks per second."""
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
COLUMNS = collect_columns(Ticks)
#: Readings of programs: each sensor, and the path of its value in the world.
SENSORS: Mapping[str, str] = MappingProxyType({each.sensor: each.reading for each in COLUMNS if each.sensor})


@dataclass(frozen=True, slots=True)
class TimedText:
    """A printed or spoken text and its time in seconds."""

    t: float
    text: str


class ProgramLine(NamedTuple):
    """The moment, in seconds, when the program reached another line.

    ``line`` is the innermost line of its file, ``outer`` the line outside all functions that led there, or 0.
    """

    t: float
    line: int
    outer: int


class LineTrace(Sequence[ProgramLine]):
    """The lines of a program in the order in which it came to them, in little memory."""

    __slots__ = ("_lines", "_outer", "_times")

    def __init__(self) -> None:
        self._times = array("d")
        self._lines, self._outer = array("i"), array("i")

    def append(self, t: float, line: int, outer: int) -> None:
        """Add a line. The arguments are those of ``ProgramLine``."""
        self._times.append(t)
        self._lines.append(line)
        self._outer.append(outer)

    def __len__(self) -> int:
        return len(self._times)

    def __iter__(self) -> Iterator[ProgramLine]:
        return map(ProgramLine, self._times, self._lines, self._outer)

    @overload
    def __getitem__(self, index: int) -> ProgramLine: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[ProgramLine, ...]: ...

    def __getitem__(self, index: int | slice) -> ProgramLine | tuple[ProgramLine, ...]:
        if isinstance(index, slice):
            return tuple(map(ProgramLine, self._times[index], self._lines[index], self._outer[index]))
        return ProgramLine(self._times[index], self._lines[index], self._outer[index])


#: Prefix of the simulator's answers when there is no responder; the text itself follows.
STAND_IN_PREFIX = "pingpong "
#: Reason why the channel lost a text; empty if it was delivered.
LossReason = Literal["", "chance", "out of range", "facing away", "blocked"]


@dataclass(frozen=True, slots=True)
class Message:
    """One text sent over the bridge.

    ``t`` is the sending time; ``delivered`` is the arrival time, or None if the text was lost. ``reply_to`` is the
    index of the answered text in the recording's messages. ``note`` lists effects of the channel: lost, duplicated,
    malformed.

    ``distance`` (mm) and ``angle`` (degrees, positive to the left) describe the other end of an infrared link, seen
    from the robot. They are measured when the text is sent; for an answer, when it arrives or is lost.
    """

    t: float
    sender: Literal["robot", "responder", "partner"]  # "partner" is the other robot, if there are two
    text: str
    delivered: float | None
    reply_to: int | None = None
    note: str = ""
    lost: LossReason = ""  # earlier releases record it only in the note
    distance: float | None = None
    angle: float | None = None
    arrived_as: str | None = None  # the received text, if the channel corrupted it
    to_partner: bool = False  # the text of a robot goes to the other robot instead of a responder

    @property
    def received(self) -> str:
        """The text as received, including corruption."""
        return self.text if self.arrived_as is None else self.arrived_as


@dataclass(frozen=True, slots=True)
class AgentMessage:
    """One text between the responder and an agent, or between two agents, during the answer to a robot's message.

    ``message`` is the index of the robot's message, -1 while the responder is loaded. ``reply_to`` is the index of the
    answered text in the recording's agent messages. For an unanswered question, ``note`` has the reason.
    """

    t: float
    sender: str
    receiver: str
    text: str  # the text sent; other values as JSON
    message: int
    reply_to: int | None = None
    note: str = ""
    is_text: bool = True


@dataclass(frozen=True, slots=True)
class AgentOutput:
    """The output of an agent: printed text and the content of its logger.txt."""

    agent: str
    printed: str
    log: str


@dataclass(frozen=True, slots=True)
class Image:
    """Images of both light sensors when the program printed IMG_DATA, and the robot's pose.

    ``left`` and ``right`` are the raw RGBA bytes of side x side pixels, row-major, top row first. ``message`` is the
    index of the message that carries them.
    """

    t: float
    tick: int
    pose: Pose
    left: bytes
    right: bytes
    message: int
    truth: str | None = None  # label of the floor under the left sensor, if any
    side: int = SENSOR_SIDE


@dataclass(frozen=True, slots=True)
class Call:
    """A call inside the responder (parser, agent, logger, predict), for the sequence diagram; not used for marks."""

    message: int  # index of the message being answered
    depth: int
    caller: str  # responder, agent ...
    callee: str  # parser, agent, logger, or the name bound to a network
    argument: str  # shortened repr
    result: str  # shortened repr
    before: int = 0  # number of agent messages at the end of the call


@dataclass(frozen=True, slots=True)
class DatalogEntry:
    """One datalog line: ``Light_left: 42 1.5`` has name Light_left, value 42.0, simtime 1.5."""

    t: float
    name: str
    value: float
    simtime: float | None


@dataclass(frozen=True, slots=True)
class Touch:
    """Start of a contact between the robot's body and a wall or an obstacle."""

    t: float
    what: str
    pose: Pose


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault: time, cause, one sentence, and the line in the student's file, if known.

    In a notebook, ``line`` counts within ``cell``, both from 1. With ``file``, it is a line of that file.
    """

    t: float
    verdict: Verdict
    who: Literal["program", "second program", "responder", "bridge", "host", "assignment"]
    message: str
    line: int | None = None
    hint: str = ""
    cell: int | None = None
    staff: str = ""  # the error in Robomark's own code, for staff
    agent: str = ""  # the agent at fault; empty for the responder itself
    file: str = ""  # the Python file that contains the line, if it is an additional file

    @property
    def place(self) -> str:
        """``line 3``, ``cell 7, line 3``, ``parser, line 3`` or ``line 3 of helper.py``; empty if unknown."""
        parts = [self.agent] if self.agent else []
        parts += [f"cell {self.cell}"] if self.cell is not None else []
        file_suffix = f" of {self.file}" if self.file else ""
        return ", ".join(parts + ([f"line {self.line}{file_suffix}"] if self.line is not None else []))


@dataclass(frozen=True, slots=True)
class Recording:
    """Complete record of a trial. ``sha256`` is the hash chain over every tick, value, print and message.

    With two robots, each has a recording; the second is the ``partner`` of the first. A recording describes its own
    robot. The exceptions are ``sha256``, which covers both, and the responder's output and log.
    """

    background: str
    start: Pose
    end: Pose
    end_t: float
    ticks: Ticks
    verdict: Verdict
    sha256: str
    printed: tuple[TimedText, ...] = ()
    spoken: tuple[TimedText, ...] = ()
    messages: tuple[Message, ...] = ()
    images: tuple[Image, ...] = ()
    calls: tuple[Call, ...] = ()
    datalog: tuple[DatalogEntry, ...] = ()
    image_log: tuple[tuple[str, str, int], ...] = ()  # (side, csv, tick) of each ``image_data left|right|both``
    touches: tuple[Touch, ...] = ()
    faults: tuple[Fault, ...] = ()
    obstacles: tuple[tuple[float, float, float, float], ...] = ()  # x, y, width, height
    beacon: tuple[float, float] | None = None  # the other end of an infrared link
    label_patches: bool = True  # the floor shows its grey label patches
    sheet: int = 0  # the seed of the digits, for a digit sheet
    robot: str = "Default_Robot"
    pen: tuple[tuple[int, bool], ...] = ()  # (tick, down) for each change of the pen
    responder_output: str = ""
    responder_log: str = ""  # the content of the responder's logger.txt
    sandbox: str = "process limits only"
    notes: tuple[str, ...] = field(default=())
    agent_messages: tuple[AgentMessage, ...] = ()
    agent_outputs: tuple[AgentOutput, ...] = ()  # of every agent, in the assignment's order
    partner: Recording | None = None
    cell_errors: tuple[Fault, ...] = ()  # of a notebook: the first cells that failed, even if the run continued
    places: Sequence[ProgramLine] = field(
        default=(), compare=False, repr=False
    )  # for hints, complete or empty; neither hashed nor stored
