"""Detection of criteria that a constant answer passes at most poses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from service.grading.judging.geometry import locate_sensor
from service.grading.judging.report_rows import Row, is_equivalent_row
from service.grading.judging.reporting import NO_LABEL, build_label_row
from sim.floors import build_floor, list_seeded_floor_names
from sim.robot import ROBOTS
from submissions.assignment.definition import Assignment
from submissions.criteria.reporting import Reports


def find_guessable_reports(assignment: Assignment) -> Iterator[str]:
    """Yield a sentence for each ``reports`` criterion of which one row fits more than half of the poses.

    Criteria with the same row for all poses, or without rows, are skipped: they don't ask for a difference.
    """
    for criterion in assignment.criteria:
        if not isinstance(criterion, Reports):
            continue
        rows = _list_label_rows(assignment, criterion) if criterion.expected == "label" else criterion.expected
        answer_kind = "label of the floor" if criterion.expected == "label" else "entry of expected"
        counts = (sum(is_equivalent_row(row, other, criterion.leeway) for other in rows) for row in set(rows))
        max_count = max(counts, default=0)
        if len(rows) < 2 * max_count < 2 * len(rows):
            yield (
                f'criterion "{criterion.id}": one {answer_kind} fits {max_count} of the {len(rows)} poses, '
                "so a constant text passes there; choose poses of which at most half have the same answer"
            )


def _list_label_rows(assignment: Assignment, criterion: Reports) -> Sequence[Row]:
    """Return the row of each pose. Empty if the floor differs between trials or has no labels."""
    world = assignment.world
    if world.image is not None or (world.sheet is None and world.background in list_seeded_floor_names()):
        return ()
    ground = build_floor(world.background, labels=world.labels, seed=world.sheet or 0)
    sensor = ROBOTS[world.robot].left_light
    return [
        build_label_row(ground.find_label(*locate_sensor(sensor, pose)) or NO_LABEL)
        for scenario in assignment.scenarios
        if not criterion.scenarios or scenario.id in criterion.scenarios
        for pose in (scenario.poses if criterion.robot == 1 else scenario.second_poses)
    ]
