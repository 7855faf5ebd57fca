"""``robomark models train`` and ``evaluate``: train or measure a classifier on this machine."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from models.cards import CardCurve, Confusion, list_classifier_names, load_card
from service.commands.models.shared import Name, Output, format_interval, write_output
from service.commands.output import create_table, print_json, print_line, print_note, print_renderables
from service.home import user_permissions

if TYPE_CHECKING:
    from rich.table import Table

    from models.evaluation import Evaluation


def train(
    name: Name,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The folder for the weights and the model card.")
    ] = Path("models-trained"),
) -> None:
    """Train a classifier again; the same versions of the libraries give the same bytes."""
    from models.training import train as train_model

    with user_permissions():
        card = train_model(name, output)
    is_identical = name in list_classifier_names() and load_card(name).sha256 == card.sha256
    print_json(file=output / card.file, training_images=card.training_images, sha256=card.sha256, same=is_identical)
    print_line(f"{output / card.file}: {card.training_images} images, sha256 {card.sha256[:16]}")
    print_line("identical to the packaged weights" if is_identical else "differs from the packaged weights")


def evaluate(name: Name, output: Output = None) -> None:
    """Measure the accuracy of a packaged classifier at its training positions, away from them, and with noise."""
    if output is not None:
        from service.reports.output_files import prepare_folder

        prepare_folder(output)
    # scikit-learn takes a second to import, and other commands do not need it.
    from models.evaluation import evaluate as measure

    result = measure(name)
    print_json(name=result.card.name, measured=asdict(result.measured), same=result.measured == result.card.measured)
    print_renderables(
        _build_summary_table(result), "", _build_confusion_table(result.card.classes, result.measured.confusion)
    )
    for curve in _build_curve_tables(result.measured.curves):
        print_renderables("", curve)
    if result.measured != result.card.measured:
        print_note("\nThis differs from the card: other library versions or other weights.")
    if output is not None:
        _write_results(result, output)


def _build_summary_table(result: Evaluation) -> Table:
    card, accuracy = result.card, result.measured.accuracy
    table = create_table("", "")
    accuracy_text = (
        f"{accuracy.share:.3f} ({accuracy.right} of {accuracy.n}), 95 % interval {format_interval(accuracy)}"
    )
    for key, value in (
        ("model", f"{card.name}, {card.file}"),
        ("task", card.task),
        ("network", card.architecture),
        ("input", card.preprocessing),
        ("trained on", f"{card.training_images} images, seed {card.seed}: {card.training_data}"),
        ("tested on", card.test_data),
        ("right", accuracy_text),
    ):
        table.add_row(key, value)
    return table


def _build_confusion_table(classes: tuple[str, ...], confusion: Confusion) -> Table:
    short_labels = [label if len(label) < 3 else str(number) for number, label in enumerate(classes)]
    numbers = (*short_labels, "recall", "precision")
    table = create_table("shown \\ read as", *numbers, right=numbers)
    for number, (label, row) in enumerate(zip(classes, confusion, strict=True)):
        answer_count = sum(other[number] for other in confusion)
        name = label if label == short_labels[number] else f"{number} {label}"
        table.add_row(
            name, *(str(count) if count else "·" for count in row), _format_share(row[number], sum(row)),
            _format_share(row[number], answer_count),
        )  # fmt: skip
    return table


def _build_curve_tables(curves: tuple[CardCurve, ...]) -> list[Table]:
    tables = []
    for curve in curves:
        numbers = (f"{curve.varied} ({curve.unit})", "right", "of", "share", "95 % interval")
        table = create_table(*numbers, right=numbers, title=f"{curve.varied}: {curve.under}")
        for value, tally in zip(curve.values, curve.tallies, strict=True):
            table.add_row(f"{value:g}", str(tally.right), str(tally.n), f"{tally.share:.3f}", format_interval(tally))
        tables.append(table)
    return tables


def _format_share(count: int, total: int) -> str:
    return f"{count / total:.3f}" if total else "·"


def _write_results(result: Evaluation, folder: Path) -> None:
    from service.reports.plots.evaluation import render_evaluation_plots

    numbers = json.dumps({"name": result.card.name} | asdict(result.measured), indent=1) + "\n"
    files = {f"{result.card.name}.json": numbers.encode()} | render_evaluation_plots(result)
    for name, data in files.items():
        write_output(folder / name, data)
