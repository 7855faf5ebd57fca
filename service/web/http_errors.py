"""An HTTP error whose message can be translated, for pages and API. ``errors.py`` renders it."""

from __future__ import annotations

from collections.abc import Mapping

from starlette.exceptions import HTTPException

from sim.sentences import Sentence


class TranslatableHTTPException(HTTPException):
    """An ``HTTPException`` with a translatable message. ``detail`` contains the English text."""

    def __init__(self, status: int, message: Sentence, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(status, str(message), headers)
        self.message = message


def extract_message(error: HTTPException) -> Sentence:
    """Return the message of any HTTPException as a Sentence."""
    return error.message if isinstance(error, TranslatableHTTPException) else Sentence(str(error.detail))
