"""Training of classifiers in a process with reproducible arithmetic.

The process uses one thread and one set of matrix and vector kernels, because the order of additions affects the last
bits.
"""

from __future__ import annotations

import hashlib
import importlib.util
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from models.cards import Card
from models.tasks import load_tasks
from sim.errors import HostError, UsageError
from sim.processes import build_arithmetic_environment, build_python_command, launch_process


def train(name: str, folder: Path) -> Card:
    """Train the classifier ``name`` and write its weights and card into ``folder``.

    Raises:
        UsageError: The name is unknown, a package with the training data is missing, or the folder cannot be created.
        HostError: The training process failed.
    """
    tasks = load_tasks()
    if name not in tasks:
        raise UsageError(f"there is no model called {name!r} to train; expected one of {', '.join(tasks)}")
    package = tasks[name].needs
    if package is not None and importlib.util.find_spec(package) is None:
        raise UsageError(
            f"training {name} needs the handwriting in {package}, which is not installed; "
            f"install it with: pip install {package}"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from error
    command = build_python_command("-m", "models.training", name, str(folder.absolute()))
    process = launch_process(
        command, build_arithmetic_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    _, errors = process.communicate()
    if process.returncode != 0:
        reason = (errors.strip().splitlines() or ["no reason given"])[-1]
        raise HostError(f"training {name} failed: {reason}")
    return Card.from_json((folder / f"{name}.json").read_text())


def _main(name: str, folder: Path) -> None:
    from models.evaluation import measure
    from models.networks import load_network

    task = load_tasks()[name]
    images, labels = task.examples()
    data = task.plan.fit(images, labels)
    results, _ = measure(task, load_network(task.file, data))
    resized = "" if task.side == 14 else f", resized to {task.side} x {task.side} by LANCZOS"
    card = Card(
        name=name,
        file=task.file,
        task=task.words,
        architecture=task.plan.describe_architecture(task.side**2, len(task.classes)),
        preprocessing=f"crop (3, 3, 17, 17) of 20 x 20 pixels, greyscale{resized}, divided by the maximum, flattened",
        training_data=task.training_words,
        training_images=len(labels),
        test_data=task.test().words,
        seed=task.plan.seed,
        classes=task.classes,
        measured=results,
        libraries={package: version(package) for package in ("joblib", "numpy", "pillow", "scikit-learn")},
        sha256=hashlib.sha256(data).hexdigest(),
    )
    (folder / card.file).write_bytes(data)
    (folder / f"{name}.json").write_text(card.to_json())


if __name__ == "__main__":
    _main(sys.argv[1], Path(sys.argv[2]))
