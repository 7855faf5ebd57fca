"""Sets Python's clock a day ahead. First on a worker's import path, it tests that no decision uses a worker's clock."""

import datetime
import time

_AHEAD = 86_400.0
_true_time = time.time
_True = datetime.datetime


class _Wrong(_True):
    @classmethod
    def now(cls, tz=None):
        return _True.now(tz) + datetime.timedelta(seconds=_AHEAD)

    @classmethod
    def utcnow(cls):
        return _True.utcnow() + datetime.timedelta(seconds=_AHEAD)


time.time = lambda: _true_time() + _AHEAD
