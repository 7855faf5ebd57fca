"""``robomark models train`` and ``evaluate``: train or measure a classifier on this machine."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from models.cards import CardCurve, Confusion, card, names
from service.commands.models.shared import Name, Output, interval, keep
from service.commands.shown import document, note, show, table, tell
from service.home import for_the_user

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

    with for_the_user():
        about = train_model(name, output)
    same = name in names() and card(name).sha256 == about.sha256
    document(file=output / about.file, training_images=about.training_images, sha256=about.sha256, same=same)
    tell(f"{output / about.file}: {about.training_images} images, sha256 {about.sha256[:16]}")
    tell("identical to the packaged weights" if same else "differs from the packaged weights")


def evaluate(name: Name, output: Output = None) -> None:
    """Measure the accuracy of a packaged classifier at its training positions, away from them, and with noise."""
    if output is not None:
        from service.reports.written import prepare_folder

        prepare_folder(output)
    # scikit-learn takes a second to import, and other commands do not need it.
    from models.evaluation import evaluate as measure

    result = measure(name)
    document(name=result.card.name, measured=asdict(result.measured), same=result.measured == result.card.measured)
    show(_head(result), "", _confusion(result.card.classes, result.measured.confusion))
    for curve in _curves(result.measured.curves):
        show("", curve)
    if result.measured != result.card.measured:
        note("\nThis differs from the card: other library versions or other weights.")
    if output is not None:
        _write(result, output)


def _head(result: Evaluation) -> Table:
    about, accuracy = result.card, result.measured.accuracy
    made = table("", "")
    right = f"{accuracy.share:.3f} ({accuracy.right} of {accuracy.n}), 95 % interval {interval(accuracy)}"
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


def _confusion(classes: tuple[str, ...], confusion: Confusion) -> Table:
    short = [label if len(label) < 3 else str(number) for number, label in enumerate(classes)]
    numbers = (*short, "recall", "precision")
    made = table("shown \\ read as", *numbers, right=numbers)
    for number, (label, row) in enumerate(zip(classes, confusion, strict=True)):
        read = sum(other[number] for other in confusion)
        name = label if label == short[number] else f"{number} {label}"
        made.add_row(
            name, *(str(count) if count else "·" for count in row), _share(row[number], sum(row)),
            _share(row[number], read),
        )  # fmt: skip
    return made


def _curves(curves: tuple[CardCurve, ...]) -> list[Table]:
    tables = []
    for curve in curves:
        numbers = (f"{curve.varied} ({curve.unit})", "right", "of", "share", "95 % interval")
        made = table(*numbers, right=numbers, title=f"{curve.varied}: {curve.under}")
        for value, tally in zip(curve.values, curve.tallies, strict=True):
            made.add_row(f"{value:g}", str(tally.right), str(tally.n), f"{tally.share:.3f}", interval(tally))
        tables.append(made)
    return tables


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else "·"


def _write(result: Evaluation, folder: Path) -> None:
    from service.reports.plots.models import evaluation_plots

    numbers = json.dumps({"name": result.card.name} | asdict(result.measured), indent=1) + "\n"
    files = {f"{result.card.name}.json": numbers.encode()} | evaluation_plots(result)
    for name, data in files.items():
        keep(folder / name, data)
