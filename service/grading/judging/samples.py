"""What one image was taken for: the smallest thing that recognition is counted in.

Plain data; how an image and its answer are found is ``classification.py``'s.
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.recording import Image


@dataclass(frozen=True, slots=True)
class Sample:
    """One image that counts, or the lack of one: what it shows, what it was taken for, and why that is."""

    trial: int  # index into the grade's trials
    image: Image | None
    truth: str
    answer: str | None
    words: str  # what happened, for a sentence
    confidence: float | None = None

    @property
    def right(self) -> bool:
        return self.answer == self.truth
