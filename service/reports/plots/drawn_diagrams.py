"""Drawing of the diagrams in a notebook, beside diagrams of the recorded events.

``own_diagrams.py`` finds the diagrams and their differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from service.grading.grade import Grade
from service.reports.plots.blocks import draw_blocks
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.difference import Differences, party_of_actor
from service.reports.plots.lanes import draw_lanes
from service.reports.plots.own_diagrams import OwnDiagram
from service.reports.plots.plot import Plot
from service.reports.plots.sequence import conversation
from service.reports.plots.style import FAULT
from service.reports.plots.talk import block_diagram, party_of, sequence_diagram, talks
from service.reports.readable import one_line
from submissions.diagram import Diagram, DiagramActor

_HAPPENED = "#8a5a00"
#: Limits of a conversation beside a diagram of it.
_MOST_EXCHANGES, _MOST_STEPS = 2, 24


def draw_own(own: OwnDiagram, grade: Grade, plot: Plot) -> Figure:
    """Draw one of the two plots of ``own``."""
    found = own.differences or Differences()
    if plot.kind == "own":
        highlights = Highlights(
            frozenset(found.drawn_actors), frozenset(found.drawn_arrows), FAULT, "✗", "drawn, did not happen"
        )
        return draw_diagram(own.cell.diagram, plot.title, "as the notebook draws it", highlights)
    trial = grade.trials[plot.subject]
    subtitle = f"{one_line(trial.scenario, 40)}, trial {trial.index + 1}, as it was observed"
    actors, arrows = found.happened_actors, found.happened_arrows
    if own.cell.diagram.kind == "blockdiag":
        happened = block_diagram(talks(trial.recording))
    else:
        happened = sequence_diagram(conversation(trial.recording, _MOST_EXCHANGES, _MOST_STEPS))
        happened = replace(happened, actors=_in_order(happened.actors, own.cell.diagram.actors))
        actors = tuple(map(party_of, actors))
        arrows = tuple((party_of(one), party_of(other)) for one, other in arrows)
    highlights = Highlights(frozenset(actors), frozenset(arrows), _HAPPENED, "+", "happened, is not drawn")
    return draw_diagram(happened, plot.title, subtitle, highlights)


def draw_diagram(diagram: Diagram, title: str, subtitle: str, highlights: Highlights) -> Figure:
    """Draw a diagram of either kind."""
    draw = draw_blocks if diagram.kind == "blockdiag" else draw_lanes
    return draw(diagram, title, subtitle, highlights)


def _in_order(parties: Sequence[DiagramActor], drawn: Sequence[DiagramActor]) -> tuple[DiagramActor, ...]:
    """Return the parties in the order in which they are drawn, followed by those that are not."""
    order = [party_of_actor(actor) for actor in drawn]
    return tuple(sorted(parties, key=lambda party: order.index(party.name) if party.name in order else len(order)))
