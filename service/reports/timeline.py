"""Timeline of a trial: prints, speech, touches and faults by time, as plain data for a template."""

from __future__ import annotations

from dataclasses import dataclass

from service.language import ENGLISH, Language
from service.reports.display_text import to_display_text
from service.reports.messages import format_party_name, iterate_robots
from service.reports.verdict_sentences import EVENT_KINDS
from sim.recording import Fault, Recording, Verdict
from sim.recording_values import collect_printed_lines

_FIRST, _LAST = 40, 15


@dataclass(frozen=True, slots=True)
class TimelineEntry:
    """One moment of a timeline. ``t`` is empty for a line that counts omitted moments. ``what`` names the kind."""

    t: str
    kind: str
    what: str
    text: str


def build_timeline(recording: Recording, language: Language = ENGLISH) -> tuple[TimelineEntry, ...]:
    """Return prints, speech, touches and faults by time. If there are too many, the middle is left out."""
    moments: list[tuple[float, str, str]] = []
    for robot, robot_recording in iterate_robots(recording):
        prefix = "" if robot_recording is recording else f"{format_party_name(robot, language)}: "
        moments += [(line.t, "printed", prefix + line.text) for line in collect_printed_lines(robot_recording)]
        moments += [(line.t, "said", prefix + line.text) for line in robot_recording.spoken]
        moments += [(touch.t, "touched", prefix + touch.what) for touch in robot_recording.touches]
        moments += [(fault.t, _classify_fault(fault), prefix + fault.message) for fault in robot_recording.faults]
    moments.sort(key=lambda moment: moment[0])
    omitted = len(moments) - _FIRST - _LAST
    if omitted <= 1:
        return tuple(_build_entry(*moment, language) for moment in moments)
    first, last = (
        [_build_entry(*moment, language) for moment in shown_moments]
        for shown_moments in (moments[:_FIRST], moments[-_LAST:])
    )
    gap = language.say("%(count)s more entries are not shown", count=language.format_integer(omitted))
    return (*first, TimelineEntry("", "", "", gap), *last)


def _classify_fault(fault: Fault) -> str:
    """Return the kind of a fault. A time limit alone is not a fault."""
    return "stopped" if fault.verdict is Verdict.TIME_LIMIT else "fault"


def _build_entry(t: float, kind: str, text: str, language: Language) -> TimelineEntry:
    return TimelineEntry(f"{t:.2f}", kind, language.say(EVENT_KINDS[kind]), to_display_text(text, 400, lines=8))
