"""A refusal that keeps its sentence and its values apart, for pages and API alike. How it looks is ``errors.py``'s."""

from __future__ import annotations

from collections.abc import Mapping

from starlette.exceptions import HTTPException

from sim.sentences import Sentence


class Declined(HTTPException):
    """An ``HTTPException`` whose detail can be said in the reader's language; ``detail`` is the English."""

    def __init__(self, status: int, said: Sentence, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(status, str(said), headers)
        self.said = said


def said_in(error: HTTPException) -> Sentence:
    """What any of them says."""
    return error.said if isinstance(error, Declined) else Sentence(str(error.detail))
