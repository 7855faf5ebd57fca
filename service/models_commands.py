"""``robomark models``: the classifiers that Robomark brings, trained and measured again on demand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from models import card, names
from models.training import train as train_model

models_app = typer.Typer(help="List, train and evaluate classifiers.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="The model's name, such as shapes.")]


@models_app.command("list")
def list_models() -> None:
    """The packaged classifiers and their accuracy on the spot, without noise."""
    table = Table("name", "file", "architecture", "images", "on the spot", box=None, pad_edge=False)
    for name in names():
        about = card(name)
        first = about.conditions[0]
        table.add_row(name, about.file, about.architecture, str(about.training_images), f"{first.right}/{first.n}")
    Console().print(table)


@models_app.command()
def train(
    name: Name,
    out: Annotated[Path, typer.Option(help="Folder for the weights and the card.")] = Path("models-trained"),
) -> None:
    """Train a classifier again; the same version of the libraries gives the same bytes."""
    about = train_model(name, out)
    same = name in names() and card(name).sha256 == about.sha256
    typer.echo(f"{out / about.file}: {about.training_images} images, sha256 {about.sha256[:16]}")
    typer.echo("the same bytes as the packaged weights" if same else "other bytes than the packaged weights")


@models_app.command()
def evaluate(name: Name) -> None:
    """Measure a packaged classifier over offsets and noise."""
    # scikit-learn takes a second to import, which no other command should have to wait for.
    from models.evaluation import evaluate as measure

    result = measure(name)
    table = Table("condition", "right", "of", "share", box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    for condition in result.conditions:
        share = condition.right / condition.n
        table.add_row(condition.name, str(condition.right), str(condition.n), f"{share:.3f}")
    console = Console()
    console.print(table)
    matrix = Table("shown \\ answered", *(str(number) for number in range(len(result.card.classes))), box=None)
    for number, (label, row) in enumerate(zip(result.card.classes, result.confusion, strict=True)):
        matrix.add_row(f"{number} {label}", *(str(count) if count else "·" for count in row))
    console.print(matrix)
