"""The fixed texts of a replay in the reader's language. Its script contains no texts.

``trial.py`` makes the texts about a trial.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.language import Language, translatable
from service.reports.robots import CALLED
from service.reports.verdict_sentences import KINDS

#: By the script's keys.
_SENTENCES: Mapping[str, str] = MappingProxyType(
    {
        "allAsTable": translatable("All that happened, as a table"),
        "apart": translatable("%(far)s mm and %(turned)s° apart"),
        "arrived": translatable("arrived %(seconds)s"),
        "arrivedAs": translatable("%(arrived)s, as %(text)s"),
        "cameOfIt": translatable("What came of it"),
        "cannotBeShown": translatable("The replay cannot be shown by this browser: %(error)s"),
        "copied": translatable("Link copied"),
        "floor": translatable("The floor with the robot. The table below describes the events in words."),
        "happens": translatable("What happens"),
        "keys": translatable(
            "Space plays; arrows step by 0.1 and 1 s, page keys by 10 s; Home and End go to the ends."
        ),
        "last": translatable("last, %(who)s %(kind)s: %(text)s"),
        "leftOut": translatable("Of %(all)s trials, %(missing)s are left out of this file."),
        "line": translatable("Line %(number)s at %(seconds)s."),
        "lineUnknown": translatable(
            "A line is marked when it has written something that no other line can have written, or has failed."
        ),
        "linesOfSource": translatable("Lines of the source"),
        "link": translatable("Link to this moment"),
        "lostAt": translatable("lost at"),
        "moment": translatable("Moment"),
        "moreLines": translatable("… %(count)s more lines"),
        "moreRows": translatable("%(count)s more are not shown."),
        "named": translatable("Sent at %(seconds)s: %(truth)s, and so it was named."),
        "near": translatable("Near the robot"),
        "neverArrived": translatable("%(befell)s: never arrived"),
        "noImage": translatable("No image is sent yet."),
        "notAnswered": translatable("not answered"),
        "notNamed": translatable("Sent at %(seconds)s: %(truth)s, not named."),
        "nothing": translatable("nothing"),
        "nothingYet": translatable("Nothing yet."),
        "now": translatable("Now %(apart)s."),
        "of": translatable("%(seconds)s of %(all)s"),
        "part": translatable("Here they part: %(seconds)s"),
        "path": translatable("Where it drove"),
        "pause": translatable("Pause"),
        "place": translatable("x %(x)s, y %(y)s mm, heading %(heading)s°"),
        "play": translatable("Play"),
        "readings": translatable("Readings"),
        "robot": translatable("Robot"),
        "sameWay": translatable("They go the same way."),
        "senses": translatable("What it senses"),
        "sent": translatable("Sent at %(seconds)s."),
        "sentLeft": translatable("Sent, left"),
        "sentRight": translatable("Sent, right"),
        "showOver": translatable("Show %(name)s over it: %(ended)s"),
        "source": translatable("Source"),
        "speed": translatable("Speed"),
        "takenFor": translatable("taken for %(answer)s"),
        "taken": translatable("Sent at %(seconds)s: %(truth)s, taken for %(answer)s."),
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


def replay_words(language: Language) -> dict[str, dict[str, str]]:
    """Return all texts for the script: sentences with ``%(name)s`` placeholders, and words by key."""
    tables = {
        "sentences": _SENTENCES,
        "kinds": {**KINDS, **_MORE_KINDS},
        "called": CALLED,
        "readings": _READINGS,
        "units": _UNITS,
    }
    return {
        name: {key: language.catalogue.gettext(words) for key, words in table.items()} for name, table in tables.items()
    }
