"""The diagrams in a notebook, and for each kind a comparison with the recorded events.

If there are several diagrams of one kind, the one closest to the events is compared. It is shown and never marked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from service.grading.grade import Grade
from service.language import ENGLISH, Language, translatable
from service.reports.display_text import to_one_line
from service.reports.plots.diagram_differences import Differences, compare_with_recording, describe_differences
from service.reports.plots.message_counts import count_messages
from service.reports.plots.plot import Plot, build_trial_name
from service.reports.verdict_sentences import format_trial_name
from service.reports.view import is_for_staff
from submissions.diagram import DiagramKind
from submissions.diagram_cells import DiagramCell

_TITLES: Mapping[DiagramKind, str] = MappingProxyType(
    {
        "blockdiag": translatable("Cell %(cell)s: block diagram"),
        "seqdiag": translatable("Cell %(cell)s: sequence diagram"),
    }
)


@dataclass(frozen=True, slots=True)
class OwnDiagram:
    """A diagram of the notebook with its plots, and its differences from the events if it is compared."""

    cell: DiagramCell
    differences: Differences | None
    title: str
    words: str
    plots: tuple[Plot, ...]


def list_own_diagrams(
    grade: Grade, cells: Sequence[DiagramCell], language: Language = ENGLISH
) -> tuple[OwnDiagram, ...]:
    """Return the diagrams of the notebook's ``cells``, from top to bottom.

    The events are those of the first trial with messages, preferably a visible one.
    """
    talking_trials = [index for index, trial in enumerate(grade.trials) if trial.recording.messages]
    talking_trials.sort(key=lambda index: is_for_staff(grade.trials[index].visibility))
    if not talking_trials:
        return tuple(_build_uncompared(cell, language) for cell in cells)
    differences_by_cell = _find_closest(grade, cells, talking_trials[0])
    return tuple(
        _build_compared(cell, differences_by_cell[cell.cell], grade, talking_trials[0], language)
        if cell.cell in differences_by_cell
        else _build_uncompared(cell, language)
        for cell in cells
    )


def format_cell_title(cell: DiagramCell, language: Language = ENGLISH) -> str:
    """Return the title of a cell's diagram."""
    return language.say(_TITLES[cell.diagram.kind], cell=cell.cell)


def _find_closest(grade: Grade, cells: Sequence[DiagramCell], trial: int) -> dict[int, Differences]:
    """Return by cell the diagram of each kind that is closest to the recorded events, the last among equals."""
    message_counts = count_messages(grade.trials[trial].recording)
    best_matches: dict[DiagramKind, tuple[int, Differences]] = {}
    for cell in cells:
        differences = compare_with_recording(cell.diagram, message_counts)
        earlier_match = best_matches.get(cell.diagram.kind)
        if differences is not None and (earlier_match is None or differences.similarity >= earlier_match[1].similarity):
            best_matches[cell.diagram.kind] = (cell.cell, differences)
    return dict(best_matches.values())


def _build_uncompared(cell: DiagramCell, language: Language) -> OwnDiagram:
    title, caption = format_cell_title(cell, language), language.say("The diagram in the notebook.")
    plot = Plot(f"own-cell-{cell.cell}", "own", 0, "", title, caption, _format_alt_text(cell, language))
    return OwnDiagram(cell, None, title, "", (plot,))


def _build_compared(
    cell: DiagramCell, differences: Differences, grade: Grade, index: int, language: Language
) -> OwnDiagram:
    say = language.say
    trial = grade.trials[index]
    name = f"cell-{cell.cell}-{build_trial_name(trial)}"
    title, description, trial_name = (
        format_cell_title(cell, language),
        describe_differences(differences, language),
        format_trial_name(trial, language),
    )
    drawn_caption, happened_caption = (
        say("The diagram in the notebook."),
        say("The events recorded in %(trial)s.", trial=trial_name),
    )
    if differences.drawn_actors or differences.drawn_arrows:
        drawn_caption += " " + say("✗: drawn, but did not happen.")
    if differences.happened_actors or differences.happened_arrows:
        happened_caption += " " + say("+: happened, but is not drawn.")
    alt_text = say("The same diagram of the events in %(trial)s.", trial=trial_name)
    plots = (
        Plot(
            f"own-{name}", "own", index, "", title, drawn_caption, f"{_format_alt_text(cell, language)} {description}"
        ),
        Plot(f"happened-{name}", "happened", index, "", say("Events"), happened_caption, f"{alt_text} {description}"),
    )
    return OwnDiagram(cell, differences, title, description, plots)


def _format_alt_text(cell: DiagramCell, language: Language) -> str:
    return language.say(
        "%(title)s of %(names)s, with %(arrows)s arrows.",
        title=format_cell_title(cell, language),
        names=", ".join(to_one_line(actor.label, 30) for actor in cell.diagram.actors),
        arrows=len(cell.diagram.arrows),
    )
