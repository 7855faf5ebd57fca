"""Capacity planning: the workers needed for a rate of submissions, by calculation and by a simulation of the queue.

``python -m benchmarks capacity`` measures the costs first. The simulation covers only queues and cores and grades no
submission.
"""

from __future__ import annotations

import heapq
import math
import random
from collections import deque
from dataclasses import dataclass
from enum import Enum, auto

from rich.console import Console
from rich.table import Table

from benchmarks import costs, rows
from benchmarks.calibration import measure_loop

#: Maximum utilisation of a core. Above it, queues become long.
_BUSIEST = 0.8
_HOUR = 3600.0
_DAY = 86_400.0
#: Cores of the database's machine.
_DATABASE_CORES = 4
#: Number of simulated submissions.
_SUBMISSIONS = 20_000
_RATES = ((10_000 / _HOUR, "10,000 an hour"), (1_000_000 / _DAY, "a million a day"), (100.0, "100 a second"))


@dataclass(frozen=True, slots=True)
class SubmissionCosts:
    """The costs of one submission in CPU seconds, on a worker's core and on the database's."""

    grading: float
    plotting: float
    accept: float
    claim: float
    finish: float

    @property
    def worker(self) -> float:
        return self.grading + self.plotting

    @property
    def database(self) -> float:
        return self.accept + self.claim + self.finish


@dataclass(frozen=True, slots=True)
class SimulationResult:
    """The result of a simulation."""

    waited: tuple[float, float]  # seconds from submission to marks: median and 95th percentile
    workers_busy: float
    database_busy: float
    most_waiting: int


class _Step(Enum):
    ARRIVES = auto()
    ACCEPTED = auto()
    CLAIMED = auto()
    GRADED = auto()
    FINISHED = auto()
    DRAWN = auto()


def compute_workers_needed(rate: float, load: SubmissionCosts) -> int:
    """Return the calculated number of workers, one per core, for at most the maximum utilisation."""
    return math.ceil(rate * load.worker / _BUSIEST)


def simulate(rate: float, workers: int, load: SubmissionCosts, submissions: int, seed: int = 0) -> SimulationResult:
    """Simulate submissions that arrive at random, ``rate`` per second.

    The database serves requests in order, and marks come before plots. The cost of a grading is uniformly distributed
    from half to one and a half times its mean.
    """
    queue = _Queue(workers, load, random.Random(seed))
    arrivals, moment = [], 0.0
    for number in range(submissions):
        moment += queue.chance.expovariate(rate)
        arrivals.append(moment)
        queue.schedule(moment, _Step.ARRIVES, number)
    queue.run()
    seconds = sorted(queue.marked[number] - begun for number, begun in enumerate(arrivals))
    return SimulationResult(
        (seconds[len(seconds) // 2], seconds[len(seconds) * 95 // 100]),
        queue.worked / (workers * queue.now),
        queue.served / (_DATABASE_CORES * queue.now),
        queue.most_waiting,
    )


class _Queue:
    """An event simulation of workers and a database."""

    def __init__(self, workers: int, load: SubmissionCosts, chance: random.Random) -> None:
        self._load = load
        self.chance = chance
        self._idle = workers
        self._free_cores = _DATABASE_CORES
        self._events: list[tuple[float, int, _Step, int]] = []
        self._asked: deque[tuple[float, _Step, int]] = deque()
        self._waiting: deque[int] = deque()
        self._undrawn: deque[int] = deque()
        self._count = 0
        self.now = self.worked = self.served = 0.0
        self.most_waiting = 0
        self.marked: dict[int, float] = {}

    def schedule(self, moment: float, step: _Step, number: int) -> None:
        self._count += 1
        heapq.heappush(self._events, (moment, self._count, step, number))

    def run(self) -> None:
        while self._events:
            self.now, _, step, number = heapq.heappop(self._events)
            self._take(step, number)
            self._start_work()

    def _take(self, step: _Step, number: int) -> None:
        if step in (_Step.ACCEPTED, _Step.CLAIMED, _Step.FINISHED):
            self._free_cores += 1
            self._serve()
        match step:
            case _Step.ARRIVES:
                self._ask(self._load.accept, _Step.ACCEPTED, number)
            case _Step.ACCEPTED:
                self._waiting.append(number)
                self.most_waiting = max(self.most_waiting, len(self._waiting))
            case _Step.CLAIMED:
                self._work(self._load.grading, _Step.GRADED, number)
            case _Step.GRADED:
                self._ask(self._load.finish, _Step.FINISHED, number)
            case _Step.FINISHED:
                self.marked[number] = self.now
                self._undrawn.append(number)
                self._idle += 1
            case _Step.DRAWN:
                self._idle += 1

    def _start_work(self) -> None:
        while self._idle and (self._waiting or self._undrawn):
            self._idle -= 1
            if self._waiting:
                self._ask(self._load.claim, _Step.CLAIMED, self._waiting.popleft())
            else:
                self._work(self._load.plotting, _Step.DRAWN, self._undrawn.popleft())

    def _work(self, seconds: float, next_step: _Step, number: int) -> None:
        duration = seconds * self.chance.uniform(0.5, 1.5)
        self.worked += duration
        self.schedule(self.now + duration, next_step, number)

    def _ask(self, seconds: float, next_step: _Step, number: int) -> None:
        self._asked.append((seconds, next_step, number))
        self._serve()

    def _serve(self) -> None:
        while self._free_cores and self._asked:
            seconds, next_step, number = self._asked.popleft()
            self._free_cores -= 1
            self.served += seconds
            self.schedule(self.now + seconds, next_step, number)


def main(_arguments: list[str]) -> int:
    """Measure the costs, then print the calculated and the simulated need for each rate."""
    measured = costs.measure_submission()
    claim = rows.measure_claim()
    load = SubmissionCosts(
        measured.grading,
        measured.sum_medians(costs.DRAWN),
        measured.sum_medians(costs.TAKEN_IN),
        claim,
        measured.sum_medians(costs.STORED),
    )
    print(
        f"the loop {measure_loop(5):.2f} s; a submission: grading {load.grading:.3f}, plots {load.plotting:.3f}, "
        f"accept {load.accept:.4f}, claim {load.claim:.4f}, finish {load.finish:.4f} s"
    )
    table = Table("submissions", "workers", "database cores", box=None)
    for heading in ("to marks p50", "p95", "workers busy", "database busy", "most waiting"):
        table.add_column(heading, justify="right")
    for rate, name in _RATES:
        workers = compute_workers_needed(rate, load)
        for count in sorted({workers, math.ceil(rate * load.worker)}):
            result = simulate(rate, count, load, _SUBMISSIONS)
            table.add_row(
                name,
                f"{count}",
                f"{rate * load.database:.2f} of {_DATABASE_CORES}",
                *(f"{seconds:.1f} s" for seconds in result.waited),
                f"{result.workers_busy:.0%}",
                f"{result.database_busy:.0%}",
                f"{result.most_waiting}",
            )
    Console(width=140).print(table)
    print(f"{_DATABASE_CORES} cores of a database are busy with {_DATABASE_CORES / load.database:.0f} a second")
    return 0
