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
        about = train_model(name, output)
    same = name in list_classifier_names() and load_card(name).sha256 == about.sha256
    print_json(file=output / about.file, training_images=about.training_images, sha256=about.sha256, same=same)
    print_line(f"{output / about.file}: {about.training_images} images, sha256 {about.sha256[:16]}")
    print_line("identical to the packaged weights" if same else "differs from the packaged weights")


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
    about, accuracy = result.card, result.measured.accuracy
    made = create_table("", "")
    right = f"{accuracy.share:.3f} ({accuracy.right} of {accuracy.n}), 95 % interval {format_interval(accuracy)}"
    for key, value in (
        ("model", f"{about.name}, {about.file}"),
        ("task", about.task),
        ("network", about.architecture),
        ("input", about.preprocessing),
        ("trained on", f"{about.training_images} images, seed {about.seed}: {about.training_data}"),
        ("tested on", about.test_data),
        ("right", right),
    ):
        made.add_row(key, value)
    return made


def _build_confusion_table(classes: tuple[str, ...], confusion: Confusion) -> Table:
    short = [label if len(label) < 3 else str(number) for number, label in enumerate(classes)]
    numbers = (*short, "recall", "precision")
    made = create_table("shown \\ read as", *numbers, right=numbers)
    for number, (label, row) in enumerate(zip(classes, confusion, strict=True)):
        read = sum(other[number] for other in confusion)
        name = label if label == short[number] else f"{number} {label}"
        made.add_row(
            name, *(str(count) if count else "·" for count in row), _format_share(row[number], sum(row)),
            _format_share(row[number], read),
        )  # fmt: skip
    return made


def _build_curve_tables(curves: tuple[CardCurve, ...]) -> list[Table]:
    tables = []
    for curve in curves:
        numbers = (f"{curve.varied} ({curve.unit})", "right", "of", "share", "95 % interval")
        made = create_table(*numbers, right=numbers, title=f"{curve.varied}: {curve.under}")
        for value, tally in zip(curve.values, curve.tallies, strict=True):
            made.add_row(f"{value:g}", str(tally.right), str(tally.n), f"{tally.share:.3f}", format_interval(tally))
        tables.append(made)
    return tables


def _format_share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else "·"


def _write_results(result: Evaluation, folder: Path) -> None:
    from service.reports.plots.evaluation import render_evaluation_plots

    numbers = json.dumps({"name": result.card.name} | asdict(result.measured), indent=1) + "\n"
    files = {f"{result.card.name}.json": numbers.encode()} | render_evaluation_plots(result)
    for name, data in files.items():
        write_output(folder / name, data)
