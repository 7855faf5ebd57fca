"""An HTTP error whose message can be translated, for pages and API. ``errors.py`` renders it."""

from __future__ import annotations

from collections.abc import Mapping

from starlette.exceptions import HTTPException

from sim.sentences import Sentence


class Declined(HTTPException):
    """An ``HTTPException`` with a translatable message. ``detail`` contains the English text."""

    def __init__(self, status: int, said: Sentence, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(status, str(said), headers)
        self.said = said


def said_in(error: HTTPException) -> Sentence:
    """Return the message of any HTTPException as a Sentence."""
    return error.said if isinstance(error, Declined) else Sentence(str(error.detail))
