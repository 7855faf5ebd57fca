"""``--language``: in which language reports are written, the same for every command that writes one."""

from __future__ import annotations

from typing import Annotated

import typer

from service.language import SOURCE, languages


def _known(code: str) -> str:
    # English needs no catalogue, and to find out which others there are takes long to load.
    if code != SOURCE and code not in languages():
        raise typer.BadParameter(f"{code!r} is not one of {', '.join(map(repr, languages()))}")
    return code


LanguageOption = Annotated[
    str,
    typer.Option(
        "--language",
        metavar="CODE",
        callback=_known,
        autocompletion=lambda: list(languages()),
        help="The language of reports and replays, as de; what is printed stays English.",
    ),
]
