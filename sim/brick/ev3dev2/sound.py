"""Speech of the robot. Texts are recorded and last as long as reading them aloud."""

from __future__ import annotations

from brick_link import link


class Sound:
    PLAY_WAIT_FOR_COMPLETE = 0
    PLAY_NO_WAIT_FOR_COMPLETE = 1
    PLAY_LOOP = 2

    def __init__(self) -> None:
        self._volume = 1.0

    def speak(self, text: object, espeak_opts: str = "", volume: int = 100, play_type: int = 0) -> None:
        """Say ``text``. With PLAY_WAIT_FOR_COMPLETE, return when the speech has ended."""
        link.notify({"do": "say", "text": str(text)})
        if play_type == self.PLAY_WAIT_FOR_COMPLETE:
            link.ask({"do": "until_said"})
        while play_type == self.PLAY_LOOP:
            link.ask({"do": "until_said"})
            link.notify({"do": "say", "text": str(text)})

    def set_volume(self, pct: float, channel: object = None) -> None:
        self._volume = pct / 100

    def get_volume(self, channel: object = None) -> float:
        return self._volume
