"""Growth of CPU costs with the length of a trial, its messages, the number of trials, and the size of a batch.

Each has three sizes, and each size is four times the previous one. The result is the cost per item in the second step
relative to the first: 1 for linear growth.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.graded_store import build_short_request
from benchmarks.measurement import RATIO, Measurement, measure_cpu_seconds
from benchmarks.simulator import FOLLOWER, build_spec, measure_through_processes
from responders.trial_spec import TrialSpec
from service.grading.trial_runner import TrialRunner
from service.settings import load_settings
from service.store.batches import intake
from service.store.engine import open_store

#: Budget for that ratio.
_MAX_RATIO = 1.5
_TALKER = "import time\nfor number in range({}):\n    print('PY::' + str(number))\n    time.sleep(0.005)\n"


def measure(times: int) -> list[Measurement]:
    """Measure the growth, with the cost per item in the last step."""
    with TrialRunner() as runner, tempfile.TemporaryDirectory() as home:

        def trial(spec: TrialSpec) -> float:
            return measure_through_processes(runner, spec)

        def length(seconds: int) -> float:
            return trial(replace(build_spec(FOLLOWER), seconds=seconds))

        def talk(messages: int) -> float:
            return trial(build_spec(_TALKER.format(messages)))

        def trials(count: int) -> float:
            return sum(trial(build_spec("pass")) for _ in range(count))

        with open_store(load_settings(home=Path(home))) as store:

            def batch(submissions: int) -> float:
                requests = [build_short_request(f"student {number}") for number in range(submissions)]
                return measure_cpu_seconds(lambda: intake.accept_batch(store, "batch", requests, [], max_attempts=3))

            return [
                _measure_growth("a simulated second of a line follower, 15 to 60 to 240", length, 15, times),
                _measure_growth("a message and its answer, 400 to 1600 to 6400", talk, 400, times),
                _measure_growth("a trial of an empty program, 2 to 8 to 32", trials, 2, times),
                _measure_growth("a submission taken in with its batch, 25 to 100 to 400", batch, 25, times),
            ]


def _measure_growth(title: str, cost: Callable[[int], float], smallest: int, times: int) -> Measurement:
    # The minimum of each, because other load only adds to it.
    small, medium, large = (
        min(cost(size) for _ in range(min(times, 3) + 1)) for size in (smallest, 4 * smallest, 16 * smallest)
    )
    late_cost = (large - medium) / (12 * smallest)
    early_cost = (medium - small) / (3 * smallest)
    return Measurement(
        f"growth: {title}",
        late_cost / early_cost,
        RATIO,
        _MAX_RATIO,
        details=f"{1000 * late_cost:.2f} ms of CPU each",
    )
