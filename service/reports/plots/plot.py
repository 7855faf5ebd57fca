"""What a plot of a report is called and says, whatever it is of.

Which plots a grade has is told by ``drawn.py`` and, of a notebook's own diagrams, by ``own_diagrams.py``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from service.grading.grade import TrialResult
from service.reports.readable import one_line
from service.reports.view import is_for_staff

#: Of every picture, in each inch.
DPI = 200
Kind = Literal[
    "path",
    "sensors",
    "confusion",
    "curves",
    "track",
    "misread",
    "predictions",
    "own",
    "happened",
]


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot of a grade. ``subject`` indexes what it is drawn of: trials, own diagrams, or else criteria.

    ``name`` ends in ``-staff`` if the plot shows anything that a student may not see before publication.
    """

    name: str
    kind: Kind
    subject: int
    scenario: str  # empty for what is of no scenario
    title: str
    caption: str
    alt: str


def title_of(what: str) -> str:
    """A plot's title: what it shows, short enough for a phone."""
    shown = one_line(what, 28)
    return shown[:1].upper() + shown[1:]


def trial_name(trial: TrialResult) -> str:
    """A trial's part of a plot's name, which says whether it is hidden."""
    return f"{slug(trial.scenario)}-{trial.index + 1}{hidden_suffix(is_for_staff(trial.visibility))}"


def hidden_suffix(hidden: bool) -> str:
    """How the name of a plot ends."""
    return "-staff" if hidden else ""


def slug(text: str) -> str:
    """``text`` as a part of a name."""
    return re.sub(r"[^A-Za-z0-9_.]+", "-", text)[:60].strip("-.") or "unnamed"
