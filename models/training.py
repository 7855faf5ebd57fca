"""Trains a classifier again, in a process of its own whose arithmetic does not depend on the machine.

One thread and one kind of matrix kernels: the order in which numbers are added decides their last bits.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from models.cards import Card
from sim.errors import HostError, UsageError

TRAINABLE = ("shapes",)

_SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",
    "PYTHONHASHSEED": "0",
}


def train(name: str, folder: Path) -> Card:
    """Write the weights and the card of ``name`` into ``folder``.

    Raises UsageError for a model that cannot be trained or a folder that cannot be written to.
    """
    if name not in TRAINABLE:
        raise UsageError(f"there is no model called {name!r} to train; expected one of {', '.join(TRAINABLE)}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder} cannot be made: {error.strerror}") from error
    process = subprocess.run(
        [sys.executable, "-m", "models.training", name, str(folder)],
        env=os.environ | _SETTINGS,
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode != 0:
        raise HostError(f"training {name} failed: {process.stderr.strip().splitlines()[-1:] or 'no reason given'}")
    return Card.from_json((folder / f"{name}.json").read_text())


def _main(name: str, folder: Path) -> None:
    from models import shapes

    data, card = shapes.train()
    (folder / card.file).write_bytes(data)
    (folder / f"{name}.json").write_text(card.to_json())


if __name__ == "__main__":
    _main(sys.argv[1], Path(sys.argv[2]))
