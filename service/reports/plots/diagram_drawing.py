"""Drawing of the diagrams in a notebook, beside diagrams of the recorded events.

``own_diagrams.py`` finds the diagrams and their differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from service.grading.grade import Grade
from service.reports.display_text import to_one_line
from service.reports.plots.block_drawing import draw_blocks
from service.reports.plots.diagram_differences import Differences, identify_actor_party
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.message_counts import (
    build_block_diagram,
    build_sequence_diagram,
    count_messages,
    identify_party,
)
from service.reports.plots.own_diagrams import OwnDiagram
from service.reports.plots.plot import Plot
from service.reports.plots.sequence import build_conversation
from service.reports.plots.sequence_drawing import draw_sequence
from service.reports.plots.style import FAULT
from submissions.diagram import Diagram, DiagramActor

_HAPPENED = "#8a5a00"
#: Limits of a conversation beside a diagram of it.
_MAX_EXCHANGES, _MAX_STEPS = 2, 24


def draw_own_diagram(own_diagram: OwnDiagram, grade: Grade, plot: Plot) -> Figure:
    """Draw one of the two plots of ``own_diagram``."""
    differences = own_diagram.differences or Differences()
    if plot.kind == "own":
        highlights = Highlights(
            frozenset(differences.drawn_actors),
            frozenset(differences.drawn_arrows),
            FAULT,
            "✗",
            "drawn, did not happen",
        )
        return draw_diagram(own_diagram.cell.diagram, plot.title, "as the notebook draws it", highlights)
    trial = grade.trials[plot.subject]
    subtitle = f"{to_one_line(trial.scenario, 40)}, trial {trial.index + 1}, as it was observed"
    actors, arrows = differences.happened_actors, differences.happened_arrows
    if own_diagram.cell.diagram.kind == "blockdiag":
        recorded_diagram = build_block_diagram(count_messages(trial.recording))
    else:
        recorded_diagram = build_sequence_diagram(build_conversation(trial.recording, _MAX_EXCHANGES, _MAX_STEPS))
        recorded_diagram = replace(
            recorded_diagram, actors=_sort_parties(recorded_diagram.actors, own_diagram.cell.diagram.actors)
        )
        actors = tuple(map(identify_party, actors))
        arrows = tuple((identify_party(one), identify_party(other)) for one, other in arrows)
    highlights = Highlights(frozenset(actors), frozenset(arrows), _HAPPENED, "+", "happened, is not drawn")
    return draw_diagram(recorded_diagram, plot.title, subtitle, highlights)


def draw_diagram(diagram: Diagram, title: str, subtitle: str, highlights: Highlights) -> Figure:
    """Draw a diagram of either kind."""
    draw = draw_blocks if diagram.kind == "blockdiag" else draw_sequence
    return draw(diagram, title, subtitle, highlights)


def _sort_parties(parties: Sequence[DiagramActor], drawn_actors: Sequence[DiagramActor]) -> tuple[DiagramActor, ...]:
    """Return the parties in the order in which they are drawn, followed by those that are not."""
    order = [identify_actor_party(actor) for actor in drawn_actors]
    return tuple(sorted(parties, key=lambda party: order.index(party.name) if party.name in order else len(order)))
