"""The strip below the floor of a film: progress, time, speed, and the latest text."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from PIL import Image, ImageDraw, ImageFont

from service.grading.grade import TrialResult
from service.reports.display_text import to_one_line
from service.reports.plots.style import FAINT, FAULT, FONT_FILE, INK, LEFT, RULE, replace_missing_glyphs
from service.reports.replay.sources import Sources
from service.reports.replay.trial import trial_to_json

#: The shortest and longest display of a text, in frames.
_MIN_CAPTION_FRAMES, _MAX_CAPTION_FRAMES = 10, 25


class Caption:
    """The text below the floor: the latest one, shown long enough to read."""

    def __init__(self, trial: TrialResult) -> None:
        trial_data = trial_to_json(trial, Sources())
        texts = [*trial_data["events"], *trial_data["messages"]]
        self._texts = sorted(texts, key=lambda text: float(text["t"]))
        self._times = [float(text["t"]) for text in self._texts]
        self._count, self._start_frame = 0, 0

    def at(self, t: float, frame: int) -> tuple[str, str]:
        """Return the text and its colour. Frames must be requested in order."""
        count = bisect_right(self._times, t + 1e-6)
        if count > self._count and (not self._count or frame - self._start_frame >= _MIN_CAPTION_FRAMES):
            self._count, self._start_frame = count, frame
        if not self._count or frame - self._start_frame > _MAX_CAPTION_FRAMES:
            return "", INK
        return _format_caption(self._texts[self._count - 1])


def _format_caption(text: Mapping[str, Any]) -> tuple[str, str]:
    if "kind" in text:
        return f"{text['who']} {text['kind']}: {text['text']}", FAULT if text["kind"] in ("fault", "touched") else INK
    loss_text = f"{text['befell']}: " if "befell" in text else ""
    return f"{text['from']} → {text['to']}: {loss_text}{text['text']}", FAULT if text["arrived"] is None else LEFT


def draw_caption_strip(
    frame: Image.Image, top: int, t: float, end: float, speed: int, caption: tuple[str, str]
) -> None:
    """Draw the progress as a bar and as a time, and the latest text."""
    draw, width = ImageDraw.Draw(frame), frame.width
    draw.rectangle((0, top, width, top + 3), fill=RULE)
    draw.rectangle((0, top, round(width * t / end) if end else width, top + 3), fill=LEFT)
    clock = f"{t:.1f} of {end:.1f} s"
    draw.text((8, top + 8), clock, fill=INK, font=_load_font())
    draw.text((width - 8, top + 8), f"{speed}×", fill=FAINT, font=_load_font(), anchor="ra")
    text, colour = caption
    draw.text(
        (8, top + 28),
        _shorten_text(replace_missing_glyphs(to_one_line(text, 200)), width - 16),
        fill=colour,
        font=_load_font(),
    )


def _shorten_text(text: str, width: int) -> str:
    if _load_font().getlength(text) <= width:
        return text
    while text and _load_font().getlength(f"{text}…") > width:
        text = text[:-1]
    return f"{text}…"


@lru_cache(maxsize=1)
def _load_font() -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(FONT_FILE), 14, layout_engine=ImageFont.Layout.BASIC)
