"""The fixed texts of a replay in the reader's language. Its script contains no texts.

``trial.py`` makes the texts about a trial.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.language import Language, translatable
from service.reports.messages import PARTY_NAMES
from service.reports.verdict_sentences import EVENT_KINDS

#: By the script's keys.
_SENTENCES: Mapping[str, str] = MappingProxyType(
    {
        "allAsTable": translatable("All events as a table"),
        "apart": translatable("%(far)s mm and %(turned)s° apart"),
        "arrived": translatable("arrived %(seconds)s"),
        "arrivedAs": translatable("%(arrived)s, as %(text)s"),
        "cameOfIt": translatable("Outcome"),
        "cannotBeShown": translatable("This browser cannot show the replay: %(error)s"),
        "copied": translatable("Link copied"),
        "floor": translatable("The floor with the robot. The table below describes the events."),
        "happens": translatable("Events"),
        "keys": translatable(
            "Space: play or pause. Arrow keys: 0.1 or 1 s. Page keys: 10 s. Home and End: start and end."
        ),
        "last": translatable("last, %(who)s %(kind)s: %(text)s"),
        "leftOut": translatable("Trials missing from this file: %(missing)s of %(all)s."),
        "line": translatable("Line %(number)s at %(seconds)s."),
        "lineUnknown": translatable(
            "A line is highlighted if its output can only come from this line, or if it failed."
        ),
        "linesOfSource": translatable("Source lines"),
        "link": translatable("Link to this moment"),
        "lostAt": translatable("lost at"),
        "moment": translatable("Moment"),
        "moreLines": translatable("… %(count)s more lines"),
        "moreRows": translatable("Not shown: %(count)s more."),
        "named": translatable("Sent at %(seconds)s: %(truth)s, identified correctly."),
        "near": translatable("Near the robot"),
        "neverArrived": translatable("%(befell)s: never arrived"),
        "noImage": translatable("No images yet."),
        "notAnswered": translatable("not answered"),
        "notNamed": translatable("Sent at %(seconds)s: %(truth)s, not identified."),
        "nothing": translatable("nothing"),
        "nothingYet": translatable("No events yet."),
        "now": translatable("Now %(apart)s."),
        "of": translatable("%(seconds)s of %(all)s"),
        "part": translatable("First difference: %(seconds)s"),
        "path": translatable("Path"),
        "pause": translatable("Pause"),
        "place": translatable("x %(x)s, y %(y)s mm, heading %(heading)s°"),
        "play": translatable("Play"),
        "readings": translatable("Readings"),
        "robot": translatable("Robot"),
        "sameWay": translatable("The paths are the same."),
        "senses": translatable("Sensor readings"),
        "sent": translatable("Sent at %(seconds)s."),
        "sentLeft": translatable("Sent, left"),
        "sentRight": translatable("Sent, right"),
        "showOver": translatable("Overlay %(name)s: %(ended)s"),
        "source": translatable("Source"),
        "speed": translatable("Speed"),
        "takenFor": translatable("identified as %(answer)s"),
        "taken": translatable("Sent at %(seconds)s: %(truth)s, identified as %(answer)s."),
        "text": translatable("Text"),
        "time": translatable("Time"),
        "trial": translatable("Trial"),
        "version": translatable("its version is %(found)s, expected %(expected)s"),
        "view": translatable("View"),
        "what": translatable("What"),
        "who": translatable("Who"),
        "whole": translatable("Whole floor"),
    }
)
#: Kinds in addition to those of the document.
_MORE_KINDS: Mapping[str, str] = MappingProxyType(
    {"image": translatable("image"), "lost": translatable("marks lost"), "message": translatable("message")}
)
_READINGS: Mapping[str, str] = MappingProxyType(
    {
        "gyro": translatable("Gyro"),
        "left_position": translatable("Left wheel"),
        "left_rgb": translatable("Left light"),
        "right_position": translatable("Right wheel"),
        "right_rgb": translatable("Right light"),
        "ultrasonic": translatable("Ultrasonic"),
    }
)
#: Units written directly after the number. Other units follow as in a reading.
_UNITS: Mapping[str, str] = MappingProxyType(
    {"degrees": "°", "degrees, clockwise": translatable("° clockwise"), "encoder degrees": "°"}
)


def translate_labels(language: Language) -> dict[str, dict[str, str]]:
    """Return all texts for the script: sentences with ``%(name)s`` placeholders, and words by key."""
    tables = {
        "sentences": _SENTENCES,
        "kinds": {**EVENT_KINDS, **_MORE_KINDS},
        "called": PARTY_NAMES,
        "readings": _READINGS,
        "units": _UNITS,
    }
    return {
        name: {key: language.catalogue.gettext(words) for key, words in table.items()} for name, table in tables.items()
    }
