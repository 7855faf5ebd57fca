"""``robomark models``: the classifiers that Robomark brings, trained and measured again on demand."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from models import card, names
from models.cards import Card, CardCurve, Confusion, Tally
from models.training import train as train_model
from service.home import for_the_user
from service.reports.written import prepare_folder
from sim.errors import UsageError

if TYPE_CHECKING:
    from models.evaluation import Evaluation

models_app = typer.Typer(help="List, train and evaluate classifiers.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="The model's name, as the list has it.")]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="DIR", help="Write the plots and the numbers into this folder.")
]


@models_app.command("list")
def list_models() -> None:
    """The packaged classifiers and how often each is right, with the 95 % interval."""
    table = Table("name", "file", "trained on", "right", "95 % interval", "of", box=None, pad_edge=False)
    for column in table.columns[2:]:
        column.justify = "right"
    for name in names():
        about = card(name)
        accuracy = about.measured.accuracy
        table.add_row(name, about.file, str(about.training_images), f"{accuracy.share:.3f}", _interval(accuracy),
                      str(accuracy.n))  # fmt: skip
    Console().print(table)


@models_app.command()
def train(
    name: Name,
    out: Annotated[Path, typer.Option(help="Folder for the weights and the card.")] = Path("models-trained"),
) -> None:
    """Train a classifier again; the same versions of the libraries give the same bytes."""
    with for_the_user():
        about = train_model(name, out)
    same = name in names() and card(name).sha256 == about.sha256
    typer.echo(f"{out / about.file}: {about.training_images} images, sha256 {about.sha256[:16]}")
    typer.echo("the same bytes as the packaged weights" if same else "other bytes than the packaged weights")


@models_app.command()
def evaluate(name: Name, report: Report = None) -> None:
    """Measure a packaged classifier where it is trained for, beside the spot, and with noise."""
    if report is not None:
        prepare_folder(report)
    # scikit-learn takes a second to import, which no other command should have to wait for.
    from models.evaluation import evaluate as measure

    result = measure(name)
    console = Console()
    console.print(_head(result))
    console.print()
    console.print(_confusion(result.card.classes, result.measured.confusion))
    for table in _curves(result.measured.curves):
        console.print()
        console.print(table)
    if result.measured != result.card.measured:
        typer.echo("\nThis is not what the card says: other versions of the libraries, or other weights.")
    if report is not None:
        _write(result, report)


@models_app.command()
def compare(
    chosen: Annotated[
        list[str], typer.Argument(metavar="NAME NAME...", help="Models of the same things, two or more.")
    ],
    report: Report = None,
) -> None:
    """What the cards of classifiers say, side by side: how often each is right, with the 95 % intervals."""
    with for_the_user():
        about = [card(name) for name in chosen]
        if len({each.classes for each in about}) > 1 or len(set(chosen)) < 2:
            raise UsageError(f"{', '.join(chosen)} cannot be compared; expected two or more models of the same things")
    if report is not None:
        prepare_folder(report)
    console = Console()
    console.print(_beside("", [("accuracy", [each.measured.accuracy for each in about])], chosen))
    for curves in _in_common(about):
        first = curves[0]
        rows = [(f"{value:g}", [curve.tallies[at] for curve in curves]) for at, value in enumerate(first.values)]
        console.print()
        console.print(_beside(f"{first.varied} ({first.unit}): {first.under}", rows, chosen))
    if report is not None:
        from service.reports.plots.models import comparison_plot

        _keep(report / f"{'-and-'.join(chosen)}.png", comparison_plot(chosen, _in_common(about)))


def _in_common(about: Sequence[Card]) -> list[list[CardCurve]]:
    """The curves that every card has, for each what the cards have of it."""
    found = []
    for first in about[0].measured.curves:
        same = [
            curve
            for each in about
            for curve in each.measured.curves
            if (curve.varied, curve.under, curve.values) == (first.varied, first.under, first.values)
        ]
        if len(same) == len(about):
            found.append(same)
    return found


def _beside(title: str, rows: Sequence[tuple[str, Sequence[Tally]]], chosen: Sequence[str]) -> Table:
    table = Table("", *chosen, "of", box=None, pad_edge=False, title=title or None, title_justify="left")
    for column in table.columns:
        column.justify = "right"
    for head, tallies in rows:
        shares = (f"{tally.share:.3f} ({_interval(tally)})" for tally in tallies)
        table.add_row(head, *shares, "/".join(dict.fromkeys(str(tally.n) for tally in tallies)))
    return table


def _head(result: Evaluation) -> Table:
    about, accuracy = result.card, result.measured.accuracy
    table = Table.grid(padding=(0, 2))
    right = f"{accuracy.share:.3f} ({accuracy.right} of {accuracy.n}), 95 % interval {_interval(accuracy)}"
    for key, value in (
        ("model", f"{about.name}, {about.file}"),
        ("task", about.task),
        ("network", about.architecture),
        ("input", about.preprocessing),
        ("trained on", f"{about.training_images} images, seed {about.seed}: {about.training_data}"),
        ("tested on", about.test_data),
        ("right", right),
    ):
        table.add_row(key, value)
    return table


def _confusion(classes: tuple[str, ...], confusion: Confusion) -> Table:
    short = [label if len(label) < 3 else str(number) for number, label in enumerate(classes)]
    table = Table("shown \\ read as", *short, "recall", "precision", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for number, (label, row) in enumerate(zip(classes, confusion, strict=True)):
        read = sum(other[number] for other in confusion)
        name = label if label == short[number] else f"{number} {label}"
        table.add_row(
            name, *(str(count) if count else "·" for count in row), _share(row[number], sum(row)),
            _share(row[number], read),
        )  # fmt: skip
    return table


def _curves(curves: tuple[CardCurve, ...]) -> list[Table]:
    tables = []
    for curve in curves:
        table = Table(f"{curve.varied} ({curve.unit})", "right", "of", "share", "95 % interval", box=None,
                      pad_edge=False, title=f"{curve.varied}: {curve.under}", title_justify="left")  # fmt: skip
        for column in table.columns:
            column.justify = "right"
        for value, tally in zip(curve.values, curve.tallies, strict=True):
            table.add_row(f"{value:g}", str(tally.right), str(tally.n), f"{tally.share:.3f}", _interval(tally))
        tables.append(table)
    return tables


def _interval(tally: Tally) -> str:
    low, high = tally.interval
    return f"{low:.3f} to {high:.3f}"


def _share(part: int, whole: int) -> str:
    return f"{part / whole:.3f}" if whole else "·"


def _write(result: Evaluation, folder: Path) -> None:
    from service.reports.plots.models import evaluation_plots

    numbers = json.dumps({"name": result.card.name} | asdict(result.measured), indent=1) + "\n"
    files = {f"{result.card.name}.json": numbers.encode()} | evaluation_plots(result)
    for name, data in files.items():
        _keep(folder / name, data)


def _keep(path: Path, data: bytes) -> None:
    try:
        with for_the_user():
            path.write_bytes(data)
    except OSError as error:
        raise UsageError(f"{path} cannot be written: {error.strerror}") from error
    typer.echo(str(path))
