"""``--film``: where a film of a trial goes, the same for every command that writes one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.errors import UsageError


def _is_gif(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".gif":
        raise UsageError(f"--film {path}: expected a name that ends in .gif")
    return path


FilmOption = Annotated[
    Path | None, typer.Option("--film", callback=_is_gif, help="Write a film of one trial to this file, a GIF.")
]
