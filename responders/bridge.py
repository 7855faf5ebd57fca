"""The bridge: serves a robot program in lock-step simulated time, with its world, its output and its responder.

Only the bridge advances time, moves the world and records events. Requests from children are untrusted. ``trial.py``
sets a trial up and tears it down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NoReturn, Protocol

from responders import message_format, packets, wire
from responders.channel import build_link
from responders.conversation import Answer, Conversation
from responders.faults import build_error_fault, build_stop_fault, describe_refusal, to_child_data_error
from responders.responder_process import LoggedData
from responders.sandbox.meter import OBJECT_BYTES, ChildStopped, JobMeter
from responders.sandbox.served_child import ServedChild
from responders.trial_spec import TrialSpec
from responders.trial_world import build_world, format_reading
from sim.arena import Arena
from sim.camera import LightCamera
from sim.drive import Wheel
from sim.random_streams import RandomStream
from sim.recording import LINE_BYTES, MILLISECOND, SECOND, STAND_IN_PREFIX, Fault, Image, LineTrace, TimedText, Verdict
from sim.world import HashChain

_READ_TIME = 10 * MILLISECOND
_WORDS_PER_MINUTE = 130
#: Maximum number of actions without a wait. The child counts too and can report the line. One motor action there may
#: arrive here as two, after the line that it is on.
_MAX_FREE_ACTIONS = 300_100
_MAX_NOTES = 200
_MAX_PLACES = 20_000


class _TrialEnded(Exception):
    """Ends the trial with a fault."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.message)
        self.fault = fault


class AnsweringResponder(Protocol):
    """A responder, as the bridge sees it: a process, or somebody outside."""

    def answer(self, text: str, t: int, message: int, logged_data: LoggedData) -> Answer:
        """Return the answer to a text that arrived at ``t``, with what the robot has logged since the last text."""


class Bridge:
    """Serves one robot program from its first frame to its last. Its list attributes then hold the recorded events."""

    def __init__(
        self,
        spec: TrialSpec,
        arena: Arena,
        camera: LightCamera,
        child: ServedChild,
        responder: AnsweringResponder | None,
        meter: JobMeter,
    ) -> None:
        self._spec = spec
        self._child = child
        self._responder = responder
        self._meter = meter
        self.now = 0
        self.chain = HashChain()
        self.world = build_world(spec, arena, camera, self.chain)
        link = build_link(spec.channel, arena, lambda: self.world.pose)
        channel_seed = spec.seed if spec.channel_seed is None else spec.channel_seed
        self.conversation = Conversation(spec.channel, channel_seed, self.chain, link, spec.never_lost)
        self.printed: list[TimedText] = []
        self.spoken: list[TimedText] = []
        self.images: list[Image] = []
        self.image_log: list[tuple[str, str, int]] = []
        self.notes: list[str] = []
        self.places = LineTrace()
        self._places_complete = spec.records_lines
        self._limit = round(spec.seconds * SECOND)
        self._speech_end = 0
        self._arrived: list[str] = []
        self._free_action_count = 0
        self._encoded_readings: dict[
            str, bytes
        ] = {}  # each sensor read since the last sensing, encoded for the hash chain
        self._readings_valid_until = 0  # the child already has all readings until this time
        self._reported_line_count = self._reported_image_count = 0
        self._remaining_output_bytes = spec.program.output_bytes

    def run(self) -> Fault | None:
        """Serve the program until it ends. Return the fault that ended it, or None."""
        try:
            return self._serve_program()
        except ChildStopped as stop:
            return self._convert_stop(stop)
        except _TrialEnded as cut:
            return self._locate_fault(cut.fault)
        except Exception as error:
            return self._convert_stop(to_child_data_error(error))

    def _serve_program(self) -> Fault | None:
        spec, values = self._spec, self.world.collect_readings()
        self._child.send(
            {
                "name": spec.program.code.name,
                "text": spec.program.code.text,
                "preamble": spec.program.preamble,
                "modules": dict(spec.program.modules),
                "tick": spec.tick,
                "sensors": {name: len(value) if isinstance(value, list) else 0 for name, value in values.items()},
                "seed": RandomStream(spec.child_seed, "program").integer(0),
                "number": spec.number,
                **({"watch": True} if spec.program.executed_statements is not None else {}),
            }
        )
        while True:
            frame = self._child.receive(wire.ROBOT)
            if frame["do"] == "end":
                return None if frame["error"] is None else build_error_fault(frame["error"], self.now, "program")
            self._serve_frame(frame)

    def _convert_stop(self, stop: ChildStopped) -> Fault:
        return build_stop_fault(stop, "program", self.now)

    def _locate_fault(self, fault: Fault) -> Fault:
        """Return a time-limit fault with the line that the program was waiting in. Other faults are unchanged."""
        if fault.verdict is not Verdict.TIME_LIMIT:
            return fault
        location = self._child.stop_and_locate()
        return replace(fault, line=location["line"], file=location["file"] or "")

    def collect_logged_data(self) -> LoggedData:
        """Return the data and images that the program has logged since the last call."""
        lines, images = self.printed[self._reported_line_count :], self.image_log[self._reported_image_count :]
        self._reported_line_count, self._reported_image_count = len(self.printed), len(self.image_log)
        data = (message_format.parse_datum(line.text, line.t) for line in lines)
        return LoggedData(
            tuple((datum.name, datum.value, datum.simtime, datum.t) for datum in data if datum is not None),
            tuple(f"{side} {csv} {tick}" for side, csv, tick in images),
        )

    def _serve_frame(self, frame: wire.Frame) -> None:
        match frame["do"]:
            case "acts":
                self._execute_actions(frame["acts"])
            case "print":
                self._print(frame["text"])
            case "polarity":
                self._count_free_action()
                self._look_up_wheel(frame["port"]).polarity = frame["polarity"][:20]
            case "motor_state":
                self._count_free_action()
                self._reply_wheel_state(frame["port"])
            case "paid_motor":
                self._advance(_READ_TIME)
                self._reply_wheel_state(frame["port"])
            case "until":
                self._wait_for_state(frame)
            case "say":
                self._say(frame["text"])
            case "until_said":
                while self.now < self._speech_end:
                    self._advance(_READ_TIME)
                self._reply(None)
            case "stuck":
                self._raise_no_wait_fault(frame["line"], frame["file"])
            case "ran" if self._spec.program.executed_statements is not None:
                self._spec.program.executed_statements.add(frame)
            case "refused":
                if len(self.notes) < _MAX_NOTES:
                    self.notes.append(describe_refusal("program", frame))

    def _execute_actions(self, actions: Sequence[packets.Action]) -> None:
        drive = self.world.drive
        for kind, number in actions:
            if type(kind) is packets.MotorCommand:
                self._count_free_action()
                port, set_point, command = kind
                wheel = drive.left if port == "outB" else drive.right
                if set_point:
                    setattr(wheel, set_point, number)
                if command is not None:
                    wheel.run(command, self.world.clock)
            elif type(kind) is packets.SensorRead:
                self._read_sensor(kind.sensor, int(number) * _READ_TIME)
            elif type(kind) is packets.LineChange:
                self._count_free_action()
                self._record_line(number)
            else:
                self._advance(int(number))
                self._reply(None)

    def _advance(self, units: int) -> None:
        """Advance simulated time by ``units``. A tick due exactly at the end of the wait still runs."""
        self._free_action_count = 0
        end = self.now + units
        last_tick = min(end, self._limit)
        tick = self._spec.tick
        due = (self.world.clock + 1) * tick
        while due <= last_tick:
            self.now = due
            self._run_tick()
            due += tick
            if self.world.clock % 3000 == 0:
                self._meter.heartbeat()
        if end > self._limit:
            self.now = self._limit
            sentence = f"the program was still running after {self._spec.seconds:g} seconds of simulated time"
            raise _TrialEnded(Fault(self.now / SECOND, Verdict.TIME_LIMIT, "program", sentence))
        self.now = end

    def _run_tick(self) -> None:
        self.take_arrivals()
        self.world.tick()

    def take_arrivals(self) -> None:
        """Collect the messages that have arrived by now. They are sent with the next reply to the program."""
        self._arrived += self.conversation.deliver(self.now)

    def _reply(self, value: Any) -> None:
        self._child.send({"t": self.now, "v": value}, self._arrived)
        self._arrived = []

    def _read_sensor(self, sensor: str, duration: int) -> None:
        """Send the value of every sensor, unless the child already has the readings of this tick."""
        end = self.now + duration
        # A read that ends after the time limit is cut like any wait, even if the child already has the value.
        is_known = end < self._readings_valid_until and end <= self._limit
        if is_known:
            self._free_action_count = 0
            self.now = end
        else:
            self._advance(duration)
            self._values = self.world.collect_readings()
            self._encoded_readings = {}
            self._readings_valid_until = (self.world.clock + 1) * self._spec.tick
        entry = self._encoded_readings.get(sensor)
        if entry is None:
            entry = self._encoded_readings[sensor] = self.chain.encode_without_time(
                sensor, format_reading(self._values[sensor])
            )
        self.chain.add_bytes(entry % end)
        if not is_known:
            self._send_readings()

    def _send_readings(self) -> None:
        numbers: list[float] = []
        for value in self._values.values():
            if isinstance(value, list):
                numbers += value
            else:
                numbers.append(value)
        if self._arrived:
            self._reply(numbers)
        else:
            self._child.send_readings(self.now, numbers)

    def _look_up_wheel(self, port: str) -> Wheel:
        return self.world.drive.left if port == "outB" else self.world.drive.right

    def _reply_wheel_state(self, port: str) -> None:
        wheel = self._look_up_wheel(port)
        value = {
            "position": wheel.position,
            "position_sp": wheel.position_sp,
            "speed": wheel.speed,
            "speed_sp": wheel.speed_sp,
            "state": wheel.state,
            "polarity": wheel.polarity,
        }
        self.chain.add(port, self.now, repr(value).encode())
        self._reply(value)

    def _wait_for_state(self, frame: wire.Frame) -> None:
        """Check the condition at once, then every 10 ms. The wait times out when its limit is strictly exceeded."""
        wheel = self._look_up_wheel(frame["port"])
        should_run = frame["state"] == "running"
        start = self.now
        while (wheel.state == "running") is not should_run:
            self._advance(_READ_TIME)
            if frame["timeout"] is not None and self.now - start > frame["timeout"]:
                self._reply(False)
                return
        self._free_action_count = 0
        self._reply(True)

    def _print(self, text: str) -> None:
        self._count_free_action()
        self._charge_output(len(text.encode()) + 1, "printed")
        self.chain.add("print", self.now, text.encode())
        kind = message_format.classify_text(text)
        if kind == "log image":
            self._log_image(text)
            return
        self.printed.append(TimedText(self.now / SECOND, text))
        if self._spec.collaborative and kind == "py":
            self._send_text(text)
        elif self._spec.collaborative and kind == "image":
            self._send_image()

    def _send_text(self, text: str) -> int:
        """Send ``text`` to the responder and queue its answer. Return the index of the message."""
        sent_text = self.conversation.send(text, self.now)
        for copy in range(sent_text.copies):
            if self._responder is not None:
                answer = self._responder.answer(sent_text.text, self.now, sent_text.message, self.collect_logged_data())
            else:
                self._meter.charge_bytes(len(STAND_IN_PREFIX) + len(text))
                answer = Answer(STAND_IN_PREFIX + sent_text.text)
            self.conversation.record_answer(sent_text, copy, answer)
        return sent_text.message

    def _send_image(self) -> None:
        left, right = self.world.render_images()
        self._charge_output(len(left) + len(right), "sent images of")
        position = self.world.left_footprint
        text = message_format.format_image_message(left, right)
        self._meter.charge_bytes(len(text) + len(left) + len(right))
        message = self._send_text(text)
        self.images.append(
            Image(
                self.now / SECOND,
                self.world.clock,
                self.world.pose,
                left,
                right,
                message,
                self._spec.floor.find_label(position.x, position.y),
                self._spec.robot.left_light.diameter,
            )
        )

    def _log_image(self, text: str) -> None:
        sides = message_format.parse_logged_sides(text)
        side_name = text.split(" ")[1] if " " in text else "undefined"
        self.printed.append(TimedText(self.now / SECOND, f"{side_name} image data logged..."))
        if not sides:
            return  # Rendering takes time that is not charged.
        images = dict(zip(("left", "right"), self.world.render_images(), strict=True))
        for side in sides:
            self._charge_output(len(images[side]), "logged images of")
            self.chain.add("image", self.now, images[side])
            pixels = message_format.format_csv(images[side])
            self._meter.charge_bytes(len(pixels))
            self.image_log.append((side, pixels, self.world.clock))

    def _say(self, text: str) -> None:
        """Queue an utterance. Its duration is its number of words at 130 words per minute."""
        self._count_free_action()
        self._charge_output(len(text.encode()) + 1, "said")
        self.chain.add("say", self.now, text.encode())
        self.spoken.append(TimedText(self.now / SECOND, text))
        length = len(text.split()) * 60 * SECOND // _WORDS_PER_MINUTE
        self._speech_end = max(self._speech_end, self.now) + length

    def _charge_output(self, size: int, verb: str) -> None:
        """Charge ``size`` to the program's output limit before the output is stored. Ends the trial at the limit."""
        self._remaining_output_bytes -= size
        if self._remaining_output_bytes < 0:
            sentence = f"the program {verb} more than {self._spec.program.output_bytes} bytes"
            raise _TrialEnded(Fault(self.now / SECOND, Verdict.OUTPUT_LIMIT, "program", sentence))

    def _record_line(self, number: float) -> None:
        """Note a line of the program. Places that are not complete would mislead, so they are dropped."""
        self._places_complete &= number > 0 and len(self.places) < _MAX_PLACES
        if self._places_complete:
            self._meter.charge_bytes(LINE_BYTES - OBJECT_BYTES)  # a line is no separate object
            self.places.append(self.now / SECOND, *packets.unpack_lines(number))
        elif self.places:
            self.places = LineTrace()

    def _count_free_action(self) -> None:
        self._free_action_count += 1
        if self._free_action_count > _MAX_FREE_ACTIONS:
            self._raise_no_wait_fault(None, None)

    def _raise_no_wait_fault(self, line: int | None, file: str | None) -> NoReturn:
        subject = "this loop never waits" if line is not None else "the program never waits"
        hint = "Let it sleep or read a sensor: the robot moves only while the program waits."
        sentence = f"{subject}, so the world cannot move"
        raise _TrialEnded(Fault(self.now / SECOND, Verdict.CPU_LIMIT, "program", sentence, line, hint, file=file or ""))
