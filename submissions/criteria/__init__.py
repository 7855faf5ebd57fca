"""What can be marked without code: one schema for each kind of criterion, told apart by ``check``.

Judging is the service's (``service/grading``); this only says what is asked, and refuses what cannot be
asked.

Every criterion is judged once a trial. A trial passes or fails, and has a score between 0 and 1: the part
of what was asked that was reached (3 of 5 lines in order, 2 of 3 messages answered), 1 exactly when it
passes. ``over`` turns the trials into marks: ``share`` is the share of trials that pass, ``all`` is
everything or nothing, ``mean``, ``median`` and ``worst`` are taken over the scores. Marks are rounded half
up, once, to two places.

Texts are compared without regard to spaces at the ends and to the length of runs of spaces.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from submissions.criteria.classification import Classification, Recognition, Robustness
from submissions.criteria.code import Functions, PythonCheck, SourceRules
from submissions.criteria.collecting import Collects
from submissions.criteria.common import CriterionBase
from submissions.criteria.drawing import Drawing
from submissions.criteria.ending import EndPose, Finishes
from submissions.criteria.line import Follows, Laps
from submissions.criteria.logged import Datalog, ImageLog
from submissions.criteria.motion import Displacement, Encounters, Excursions, Moves
from submissions.criteria.path import Circuits, Closest, KeepsOut, Spread, StaysInside, TouchesNothing, Visits
from submissions.criteria.reporting import Events, Reports, WordSequence
from submissions.criteria.stopping import StopOn
from submissions.criteria.texts import Messages, Prints, Replies, Says
from submissions.criteria.timing import Ranking, Timing

__all__ = [
    "SCHEMAS",
    "Circuits",
    "Classification",
    "Closest",
    "Collects",
    "Criterion",
    "Datalog",
    "Displacement",
    "Drawing",
    "Encounters",
    "EndPose",
    "Events",
    "Excursions",
    "Finishes",
    "Follows",
    "Functions",
    "ImageLog",
    "KeepsOut",
    "Laps",
    "Messages",
    "Moves",
    "Prints",
    "PythonCheck",
    "Ranking",
    "Recognition",
    "Replies",
    "Reports",
    "Robustness",
    "Says",
    "SourceRules",
    "Spread",
    "StaysInside",
    "StopOn",
    "Timing",
    "TouchesNothing",
    "Visits",
    "WordSequence",
]

Criterion = Annotated[
    Finishes
    | Prints
    | Says
    | Messages
    | Replies
    | Classification
    | Robustness
    | Collects
    | EndPose
    | StopOn
    | Reports
    | WordSequence
    | Events
    | Datalog
    | ImageLog
    | SourceRules
    | Functions
    | PythonCheck
    | Timing
    | Ranking
    | Displacement
    | Moves
    | Excursions
    | Encounters
    | Drawing
    | Visits
    | StaysInside
    | KeepsOut
    | TouchesNothing
    | Closest
    | Circuits
    | Follows
    | Laps
    | Spread,
    Field(discriminator="check"),
]

#: The schema for each value of ``check``.
SCHEMAS: dict[str, type[CriterionBase]] = {
    "finishes": Finishes,
    "prints": Prints,
    "says": Says,
    "messages": Messages,
    "replies": Replies,
    "classification": Classification,
    "robustness": Robustness,
    "collects": Collects,
    "pose": EndPose,
    "stop_on": StopOn,
    "reports": Reports,
    "sequence": WordSequence,
    "events": Events,
    "datalog": Datalog,
    "image_log": ImageLog,
    "source": SourceRules,
    "functions": Functions,
    "python": PythonCheck,
    "timing": Timing,
    "ranking": Ranking,
    "displacement": Displacement,
    "moves": Moves,
    "excursions": Excursions,
    "encounters": Encounters,
    "drawing": Drawing,
    "visits": Visits,
    "stays_inside": StaysInside,
    "keeps_out": KeepsOut,
    "touches_nothing": TouchesNothing,
    "closest": Closest,
    "circuits": Circuits,
    "follows": Follows,
    "laps": Laps,
    "spread": Spread,
}
