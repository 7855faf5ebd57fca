"""The title and description of a plot in a report.

``grade_plots.py`` lists the plots of a grade, and ``own_diagrams.py`` those of a notebook's own diagrams.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from service.grading.grade import TrialResult
from service.reports.display_text import to_one_line
from service.reports.view import is_for_staff

#: Resolution of every image, per inch.
DPI = 200
PlotKind = Literal[
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
#: The kinds that reports show as SVG. The others consist of images, or are drawn by Matplotlib's figures.
VECTOR_KINDS: frozenset[PlotKind] = frozenset(("path", "sensors", "confusion", "curves", "track"))


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot of a grade. ``subject`` is the index of its subject: a trial, an own diagram, or a criterion.

    ``name`` ends in ``-staff`` if the plot shows anything that students may not see before publication.
    """

    name: str
    kind: PlotKind
    subject: int
    scenario: str  # empty if it belongs to no scenario
    title: str
    caption: str
    alt: str


def format_title(text: str) -> str:
    """Return a plot's title, short enough for a phone."""
    title = to_one_line(text, 28)
    return title[:1].upper() + title[1:]


def build_trial_name(trial: TrialResult) -> str:
    """Return a trial's part of a plot's name, which marks hidden trials."""
    return f"{slugify(trial.scenario)}-{trial.index + 1}{build_hidden_suffix(is_for_staff(trial.visibility))}"


def build_hidden_suffix(hidden: bool) -> str:
    """Return the suffix of a plot's name."""
    return "-staff" if hidden else ""


def slugify(text: str) -> str:
    """Return ``text`` as a part of a name."""
    return re.sub(r"[^A-Za-z0-9_.]+", "-", text)[:60].strip("-.") or "unnamed"
