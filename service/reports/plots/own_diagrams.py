"""The diagrams that a notebook draws itself, and of each kind one beside what happened, with what differs highlighted.

Of several diagrams of a kind the one that is closest to what happened is compared. Shown, never marked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from matplotlib.figure import Figure

from service.grading.grade import Grade
from service.reports.plots.blocks import draw_blocks
from service.reports.plots.diagram_parts import Highlights
from service.reports.plots.difference import Differences, differences, in_words, party_of_actor
from service.reports.plots.lanes import draw_lanes
from service.reports.plots.plot import Plot, trial_name
from service.reports.plots.sequence import conversation
from service.reports.plots.style import FAULT
from service.reports.plots.talk import block_diagram, party_of, sequence_diagram, talks
from service.reports.readable import one_line
from service.reports.view import is_for_staff
from submissions.diagram import Diagram, DiagramActor, DiagramKind
from submissions.diagram_cells import DiagramCell

_HAPPENED = "#8a5a00"
_KINDS: Mapping[DiagramKind, str] = MappingProxyType({"blockdiag": "block diagram", "seqdiag": "sequence diagram"})
#: Of a conversation, beside a diagram of it.
_MOST_EXCHANGES, _MOST_STEPS = 2, 24


@dataclass(frozen=True, slots=True)
class OwnDiagram:
    """A diagram of the notebook's, its plots, and how it differs from what happened, if it is compared with that."""

    cell: DiagramCell
    differences: Differences | None
    title: str
    words: str
    plots: tuple[Plot, ...]


def own_diagrams(grade: Grade, cells: Sequence[DiagramCell]) -> tuple[OwnDiagram, ...]:
    """The diagrams of the notebook's ``cells``, from the top.

    What happened is that of the first trial in which anything was sent, a visible one where there is one.
    """
    talking = [index for index, trial in enumerate(grade.trials) if trial.recording.messages]
    talking.sort(key=lambda index: is_for_staff(grade.trials[index].visibility))
    if not talking:
        return tuple(_alone(cell) for cell in cells)
    compared = _closest(grade, cells, talking[0])
    return tuple(
        _compared(cell, compared[cell.cell], grade, talking[0]) if cell.cell in compared else _alone(cell)
        for cell in cells
    )


def draw_own(own: OwnDiagram, grade: Grade, plot: Plot) -> Figure:
    """One of the two plots of ``own``."""
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
    """A diagram of either kind."""
    draw = draw_blocks if diagram.kind == "blockdiag" else draw_lanes
    return draw(diagram, title, subtitle, highlights)


def title_of_cell(cell: DiagramCell) -> str:
    """What a cell's diagram is called."""
    return f"Cell {cell.cell}: {_KINDS[cell.diagram.kind]}"


def _closest(grade: Grade, cells: Sequence[DiagramCell], trial: int) -> dict[int, Differences]:
    """Of each kind the diagram that is most like it, the last of equals, by its cell."""
    told = talks(grade.trials[trial].recording)
    best: dict[DiagramKind, tuple[int, Differences]] = {}
    for cell in cells:
        found = differences(cell.diagram, told)
        before = best.get(cell.diagram.kind)
        if found is not None and (before is None or found.alike >= before[1].alike):
            best[cell.diagram.kind] = (cell.cell, found)
    return dict(best.values())


def _in_order(parties: Sequence[DiagramActor], drawn: Sequence[DiagramActor]) -> tuple[DiagramActor, ...]:
    """Parties in the order in which they are drawn; those that are not come after them."""
    order = [party_of_actor(actor) for actor in drawn]
    return tuple(sorted(parties, key=lambda party: order.index(party.name) if party.name in order else len(order)))


def _alone(cell: DiagramCell) -> OwnDiagram:
    plot = Plot(f"own-cell-{cell.cell}", "own", 0, "", title_of_cell(cell), "As the notebook draws it.", _alt(cell))
    return OwnDiagram(cell, None, plot.title, "", (plot,))


def _compared(cell: DiagramCell, found: Differences, grade: Grade, index: int) -> OwnDiagram:
    trial = grade.trials[index]
    title, words, name = title_of_cell(cell), in_words(found), f"cell-{cell.cell}-{trial_name(trial)}"
    where = f"{one_line(trial.scenario, 60)}, trial {trial.index + 1}"
    drawn = " ✗: it did not happen." if found.drawn_actors or found.drawn_arrows else ""
    happened = " +: it is not drawn." if found.happened_actors or found.happened_arrows else ""
    plots = (
        Plot(f"own-{name}", "own", index, "", title, f"As the notebook draws it.{drawn}", f"{_alt(cell)} {words}"),
        Plot(
            f"happened-{name}", "happened", index, "", "What happened",
            f"As it was observed in {where}.{happened}", f"The same of what happened in {where}. {words}",
        ),
    )  # fmt: skip
    return OwnDiagram(cell, found, title, words, plots)


def _alt(cell: DiagramCell) -> str:
    names = ", ".join(one_line(actor.label, 30) for actor in cell.diagram.actors)
    return f"{title_of_cell(cell)} of {names}, with {len(cell.diagram.arrows)} arrows."
