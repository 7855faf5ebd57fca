"""``robomark models list`` and ``compare``: the contents of model cards. These commands measure nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from models.cards import Card, CardCurve, Tally, list_classifier_names, load_card
from service.commands.models.shared import Output, format_interval, write_output
from service.commands.output import create_table, print_json, print_renderables
from service.home import user_permissions
from sim.errors import UsageError

if TYPE_CHECKING:
    from rich.table import Table


def list_models() -> None:
    """The packaged classifiers and how often each is right, with the 95 % interval."""
    cards = [load_card(name) for name in list_classifier_names()]
    print_json(models=[_card_to_json(about) for about in cards])
    numbers = ("trained on", "right", "95 % interval", "of")
    table = create_table("name", "file", *numbers, right=numbers)
    for card in cards:
        accuracy = card.measured.accuracy
        share = f"{accuracy.share:.3f}"
        interval = format_interval(accuracy)
        table.add_row(card.name, card.file, str(card.training_images), share, interval, str(accuracy.n))
    print_renderables(table)


def compare(
    chosen: Annotated[list[str], typer.Argument(metavar="NAME NAME...", help="Two or more models of the same things.")],
    output: Output = None,
) -> None:
    """Compare the cards of classifiers: the accuracy of each, with 95 % intervals."""
    with user_permissions():
        cards = [load_card(name) for name in chosen]
        if len({each.classes for each in cards}) > 1 or len(set(chosen)) < 2:
            raise UsageError(f"{', '.join(chosen)} cannot be compared; expected two or more models of the same classes")
    if output is not None:
        from service.reports.output_files import prepare_folder

        prepare_folder(output)
    print_json(models=[_card_to_json(each) for each in cards], curves=_find_common_curves(cards))
    print_renderables(_build_comparison_table("", [("accuracy", [each.measured.accuracy for each in cards])], chosen))
    for curves in _find_common_curves(cards):
        first_curve = curves[0]
        rows = [(f"{value:g}", [curve.tallies[at] for curve in curves]) for at, value in enumerate(first_curve.values)]
        print_renderables(
            "", _build_comparison_table(f"{first_curve.varied} ({first_curve.unit}): {first_curve.under}", rows, chosen)
        )
    if output is not None:
        from service.reports.plots.evaluation import render_comparison_plot

        write_output(output / f"{'-and-'.join(chosen)}.png", render_comparison_plot(chosen, _find_common_curves(cards)))


def _card_to_json(card: Card) -> dict[str, Any]:
    """Return the JSON value for a model card."""
    accuracy = card.measured.accuracy
    low, high = accuracy.interval
    return {
        "name": card.name,
        "file": card.file,
        "training_images": card.training_images,
        "classes": card.classes,
        "accuracy": {"value": accuracy.share, "low": low, "high": high, "n": accuracy.n},
    }


def _find_common_curves(cards: Sequence[Card]) -> list[list[CardCurve]]:
    """Return the curves that all cards share. Each entry lists the curve of every card."""
    common_curves = []
    for first_curve in cards[0].measured.curves:
        matching_curves = [
            curve
            for each in cards
            for curve in each.measured.curves
            if (curve.varied, curve.under, curve.values) == (first_curve.varied, first_curve.under, first_curve.values)
        ]
        if len(matching_curves) == len(cards):
            common_curves.append(matching_curves)
    return common_curves


def _build_comparison_table(title: str, rows: Sequence[tuple[str, Sequence[Tally]]], names: Sequence[str]) -> Table:
    table = create_table("", *names, "of", right=("", *names, "of"), title=title)
    for heading, tallies in rows:
        shares = (f"{tally.share:.3f} ({format_interval(tally)})" for tally in tallies)
        table.add_row(heading, *shares, "/".join(dict.fromkeys(str(tally.n) for tally in tallies)))
    return table
