"""Quality of copy detection: false alarms among the catalogue's references, detected copies, and the costs.

Run it with ``python -m benchmarks.similar``. The catalogue has few authors, and some of its responders are derived from
others, so each pair that counts as similar is listed.
"""

from __future__ import annotations

import random
import resource
import sys
import time
from collections.abc import Iterator, Mapping
from itertools import combinations

from benchmarks.harness.disguises import DISGUISES
from models.intervals import compute_wilson_interval
from service.similarity.similar_sources import MIN_TOKENS, SIMILARITY_THRESHOLD, build_source, compare_sources
from service.similarity.sources import collect_given_code
from submissions.assignment.examples import locate_examples
from submissions.assignment.folder import REFERENCE, list_catalogue_ids
from submissions.assignment.reader import find_assignment

#: Independent solutions of one assignment, as their texts show: one per author and idea.
WRITTEN_ANEW = (
    ("coin-tosses", "responder.py", ("reference", "runs-off-the-end")),
    ("digits-on-a-sheet", "responder.py", ("reference", "learnt-by-heart", "echoes-the-patch")),
    ("json-queue", "robot.py", ("seed", "broken")),
    ("rule-set", "responder.py", ("reference", "order-of-rules")),
    ("rules-without-a-network", "responder.py", ("reference", "brings-a-network", "looks-at-the-darkness")),
    ("shape-at-random", "responder.py", ("reference", "seed", "rules")),
    ("shape-recognition", "responder.py", ("reference", "seed")),
    ("shapes-off-centre", "responder.py", ("reference", "only-in-the-middle")),
    ("shapes-on-the-move", "responder.py", ("reference", "by-the-way-driven", "echoes-the-patch")),
)
#: Lines of the submissions for measuring costs, about 250 tokens.
_LINES = 25


def main() -> int:
    """Print the three tables."""
    references = dict(_read_references())
    given_code = {name: collect_given_code(find_assignment(name)) for name, _ in references}
    print(f"alike from {SIMILARITY_THRESHOLD} on; {MIN_TOKENS} own tokens or more")
    _print_alarms_within(given_code)
    _print_alarms_between(references, given_code)
    _print_detected_copies(references, given_code)
    for students in (60, 500, 2000):
        _print_cost(students)
    return 0


def _read_references() -> Iterator[tuple[tuple[str, str], str]]:
    for name in list_catalogue_ids():
        for path in sorted((locate_examples(name) / REFERENCE).glob("*.py")):
            yield (name, path.name), path.read_text(encoding="utf-8")


def _print_alarms_within(given_code: Mapping[str, tuple[str, ...]]) -> None:
    """Print the false alarms among independent solutions of the same assignment."""
    pairs, alarms, highest = 0, [], 0.0
    for name, file, solutions in WRITTEN_ANEW:
        texts = {each: (locate_examples(name) / each / file).read_text(encoding="utf-8") for each in solutions}
        for first_name, second_name in combinations(texts, 2):
            sources = [build_source(each, file, texts[each]) for each in (first_name, second_name)]
            comparison = compare_sources(sources, given_code[name], cutoff=0.0)
            if not comparison.too_short:
                pairs += 1
                highest = max([highest, *(each.share for each in comparison.alike)])
                alarms += [
                    f"{name}: {first_name}, {second_name}"
                    for each in comparison.alike
                    if each.share >= SIMILARITY_THRESHOLD
                ]
    print(f"one assignment, written anew: {_format_rate(len(alarms), pairs)}; the highest share is {highest:.2f}")


def _print_alarms_between(references: Mapping[tuple[str, str], str], given_code: Mapping[str, tuple[str, ...]]) -> None:
    """Print the false alarms between all references: programs with programs, responders with responders."""
    for file in ("robot.py", "responder.py"):
        pairs, alarms = 0, []
        names = [name for name, which in references if which == file]
        for first_name, second_name in combinations(names, 2):
            sources = [build_source(name, file, references[name, file]) for name in (first_name, second_name)]
            comparison = compare_sources(sources, [*given_code[first_name], *given_code[second_name]])
            if not comparison.too_short:
                pairs += 1
                alarms += [f"{first_name} and {second_name} {each.share:.2f}" for each in comparison.alike]
        print(f"references, {file}: {_format_rate(len(alarms), pairs)}")
        print("".join(f"    {alarm}\n" for alarm in alarms), end="")


def _format_rate(alarms: int, pairs: int) -> str:
    low, high = compute_wilson_interval(alarms, pairs)
    return f"{alarms} of {pairs} pairs are alike ({low:.0%} to {high:.0%})"


def _print_detected_copies(
    references: Mapping[tuple[str, str], str], given_code: Mapping[str, tuple[str, ...]]
) -> None:
    for disguise, copyist in DISGUISES.items():
        detected = copies = 0
        for (name, file), text in references.items():
            comparison = compare_sources(
                [build_source("one", file, text), build_source("other", file, copyist(text))], given_code[name]
            )
            if "one" not in comparison.too_short:
                copies += 1
                detected += bool(comparison.alike)
        print(f"{disguise}: {detected} of {copies} copies found")


def _print_cost(students: int) -> None:
    texts = [_build_program(random.Random(number)) for number in range(students)]
    start = time.process_time()
    sources = [build_source(str(number), "robot.py", text) for number, text in enumerate(texts)]
    alike = compare_sources(sources, []).alike
    seconds, megabytes = time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{students} students, {len(sources[0].tokens)} tokens each: {seconds:.2f} s, {len(alike)} alike, ", end="")
    print(f"{megabytes:.0f} MB at most in this process")


def _build_program(chance: random.Random) -> str:
    """Return lines in students' style, each chosen from a few."""
    lines = []
    for _ in range(_LINES):
        motor = chance.choice(("tank_drive", "tank_turn", "left_motor", "right_motor"))
        move = chance.choice(("on_for_seconds", "on_for_rotations", "on_for_degrees", "on"))
        sensor = chance.choice(("colorLeft", "colorRight", "gyro", "ultrasonic"))
        lines.append(
            chance.choice(
                (
                    f"{motor}.{move}(SpeedPercent(30), SpeedPercent(speed), 2)",
                    f"while {sensor}.{chance.choice(('reflected_light_intensity', 'color', 'angle'))} > 40:",
                    f"    value = {sensor}.distance {chance.choice('+-*/')} {chance.choice(('7', 'speed'))}",
                    f"    if value {chance.choice('<>')} limit {chance.choice(('and', 'or'))} not done:",
                    f"say({chance.choice(('str(value)', 'text', 'message[0]'))})",
                )
            )
        )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
