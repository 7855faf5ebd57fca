"""How many workers a rate of submissions needs and what runs out first: on paper, and by a simulation of the queue.

``python -m benchmarks capacity`` measures the costs here first. The simulation is of queues and cores alone: it
runs no submission.
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
from benchmarks.calibration import loop_seconds

#: A core that is busy for more than this part of its time lets queues grow long.
_BUSIEST = 0.8
_HOUR = 3600.0
_DAY = 86_400.0
#: Of a database's machine.
_DATABASE_CORES = 4
#: How many submissions a simulation runs.
_SUBMISSIONS = 20_000
_RATES = ((10_000 / _HOUR, "10,000 an hour"), (1_000_000 / _DAY, "a million a day"), (100.0, "100 a second"))


@dataclass(frozen=True, slots=True)
class Load:
    """What one submission costs, CPU seconds: of a worker's core, and of the database's."""

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
class Outcome:
    """What came of a simulated hour or so."""

    waited: tuple[float, float]  # seconds from submission to marks: the median, and the 95th of a hundred
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


def workers_needed(rate: float, load: Load) -> int:
    """On paper: so many cores that none is too busy."""
    return math.ceil(rate * load.worker / _BUSIEST)


def simulate(rate: float, workers: int, load: Load, submissions: int, seed: int = 0) -> Outcome:
    """Submissions come by chance at ``rate`` a second; the database serves in order; marks go before plots.

    A grading takes from half to one and a half times what it costs, evenly by chance.
    """
    queue = _Queue(workers, load, random.Random(seed))
    arrivals, at = [], 0.0
    for number in range(submissions):
        at += queue.chance.expovariate(rate)
        arrivals.append(at)
        queue.later(at, _Step.ARRIVES, number)
    queue.run()
    seconds = sorted(queue.marked[number] - begun for number, begun in enumerate(arrivals))
    return Outcome(
        (seconds[len(seconds) // 2], seconds[len(seconds) * 95 // 100]),
        queue.worked / (workers * queue.now),
        queue.served / (_DATABASE_CORES * queue.now),
        queue.most_waiting,
    )


class _Queue:
    """Workers and a database, from one event to the next."""

    def __init__(self, workers: int, load: Load, chance: random.Random) -> None:
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

    def later(self, at: float, step: _Step, number: int) -> None:
        self._count += 1
        heapq.heappush(self._events, (at, self._count, step, number))

    def run(self) -> None:
        while self._events:
            self.now, _, step, number = heapq.heappop(self._events)
            self._take(step, number)
            self._set_to_work()

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

    def _set_to_work(self) -> None:
        while self._idle and (self._waiting or self._undrawn):
            self._idle -= 1
            if self._waiting:
                self._ask(self._load.claim, _Step.CLAIMED, self._waiting.popleft())
            else:
                self._work(self._load.plotting, _Step.DRAWN, self._undrawn.popleft())

    def _work(self, seconds: float, then: _Step, number: int) -> None:
        taken = seconds * self.chance.uniform(0.5, 1.5)
        self.worked += taken
        self.later(self.now + taken, then, number)

    def _ask(self, seconds: float, then: _Step, number: int) -> None:
        self._asked.append((seconds, then, number))
        self._serve()

    def _serve(self) -> None:
        while self._free_cores and self._asked:
            seconds, then, number = self._asked.popleft()
            self._free_cores -= 1
            self.served += seconds
            self.later(self.now + seconds, then, number)


def main(_arguments: list[str]) -> int:
    """Measure the costs, then print what each rate needs on paper, and what the simulation makes of that."""
    measured = costs.of_submission()
    claim = rows.claim_seconds()
    load = Load(
        measured.grading,
        measured.of(costs.DRAWN),
        measured.of(costs.TAKEN_IN),
        claim,
        measured.of(costs.STORED),
    )
    print(
        f"the loop {loop_seconds(5):.2f} s; a submission: grading {load.grading:.3f}, plots {load.plotting:.3f}, "
        f"accept {load.accept:.4f}, claim {load.claim:.4f}, finish {load.finish:.4f} s"
    )
    table = Table("submissions", "workers", "database cores", box=None)
    for heading in ("to marks p50", "p95", "workers busy", "database busy", "most waiting"):
        table.add_column(heading, justify="right")
    for rate, name in _RATES:
        workers = workers_needed(rate, load)
        for count in sorted({workers, math.ceil(rate * load.worker)}):
            came = simulate(rate, count, load, _SUBMISSIONS)
            table.add_row(
                name,
                f"{count}",
                f"{rate * load.database:.2f} of {_DATABASE_CORES}",
                *(f"{seconds:.1f} s" for seconds in came.waited),
                f"{came.workers_busy:.0%}",
                f"{came.database_busy:.0%}",
                f"{came.most_waiting}",
            )
    Console(width=140).print(table)
    print(f"{_DATABASE_CORES} cores of a database are busy with {_DATABASE_CORES / load.database:.0f} a second")
    return 0
