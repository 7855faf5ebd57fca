"""Judging of logged data: datalog series, and images.

Images and readings come from the simulator's recording. Values are those the program printed, so they may be invented.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from types import MappingProxyType

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import Side, find_light_sensor, locate_footprint, measure_floor_share
from service.grading.judging.judge_declaration import declare_judge
from service.grading.judging.label_patches import GREYS, decode_label
from service.grading.judging.outcome import Outcome, Strays, apply_stray_penalty, fail_with, pass_with
from service.grading.judging.sensor_readings import match_readings
from service.language import translatable
from sim.camera import HEIGHT, WIDTH, build_sensor_mask
from sim.floors import Floor
from sim.light_sensors import Footprint
from sim.recording import DatalogEntry, Image, Recording
from sim.recording_values import get_pose_after, get_pose_at, rebuild_floor, tick_to_seconds
from sim.sentences import Sentence
from submissions.criteria.logs import Datalog, ImageLog, Instrument

Check = tuple[Fraction, str]  # the fraction reached, and the message if it is below 1

_READINGS: Mapping[Instrument, Sentence] = MappingProxyType(
    {
        "left light": Sentence("readings of the left light sensor"),
        "right light": Sentence("readings of the right light sensor"),
        "ultrasonic": Sentence("readings of the ultrasonic sensor"),
        "gyro": Sentence("readings of the gyro"),
        "left wheel": Sentence("readings of the left wheel"),
        "right wheel": Sentence("readings of the right wheel"),
    }
)


@declare_judge(Datalog)
def judge_datalog(criterion: Datalog, trial: TrialResult) -> Outcome:
    """Judge the samples of one datalog series; if required, only those that a sensor read."""
    recording = trial.recording
    name = criterion.series
    logged_samples = [datum for datum in recording.datalog if datum.name == name]
    measured_samples = _filter_measured_samples(criterion, logged_samples, recording)
    samples = measured_samples if criterion.measured is None else _drop_repeats(measured_samples)
    invented_count = len(logged_samples) - len(measured_samples)
    values = [datum.value for datum in samples]
    measures = (Measure(Sentence("samples"), float(len(values))), *_measure_extremes(values))
    if criterion.measured is not None:
        measures += (Measure(Sentence("made up"), float(invented_count)),)
    readings = _READINGS[criterion.measured] if criterion.measured is not None else ""
    if logged_samples and not values:
        message = Sentence(
            "Expected %(name)s to be %(readings)s, but none of the %(count)s samples is the reading at the time of "
            "printing.",
            name=name,
            readings=readings,
            count=len(logged_samples),
        )
        return fail_with(message, measures=measures)
    if not values and (criterion.at_least or criterion.plateaus or criterion.between or criterion.covers):
        return fail_with(
            Sentence(
                'Expected the program to log %(name)s, but the datalog has none: no line like "%(name)s: 42" was '
                "printed.",
                name=name,
            )
        )
    checks = _check_datalog(criterion, samples, recording)
    if criterion.plateaus:
        checks.append(_check_plateaus(criterion, values))
    problem = next((words for reached, words in checks if reached < 1), None)
    summary = problem or Sentence(
        "The program logged %(count)s samples of %(name)s as expected", count=len(values), name=name
    )
    message = (
        Sentence(
            "%(summary)s; %(count)s of %(total)s are not %(readings)s at the time of printing.",
            summary=summary,
            count=invented_count,
            total=len(logged_samples),
            readings=readings,
        )
        if invented_count
        else Sentence("%(summary)s.", summary=summary)
    )
    if problem is None:
        outcome = pass_with(message, measures=measures)
    else:
        score = sum((reached for reached, _ in checks), Fraction(0)) / len(checks)
        outcome = fail_with(message, score=score, measures=measures)
    strays = Strays(
        Sentence("so many logged values are no readings"),
        invented_count,
        advice=translatable("Read the sensor again for each value."),
    )
    return apply_stray_penalty(outcome, criterion, max(len(samples), 1), strays)


def _filter_measured_samples(
    criterion: Datalog, logged_samples: Sequence[DatalogEntry], recording: Recording
) -> list[DatalogEntry]:
    """Return the samples that the instrument read; all if the criterion names none."""
    if criterion.measured is None:
        return list(logged_samples)
    values, times = [datum.value for datum in logged_samples], [datum.t for datum in logged_samples]
    is_read = match_readings(values, times, (criterion.measured,), recording)
    return [datum for datum, true in zip(logged_samples, is_read.tolist(), strict=True) if true]


def _describe_images(count: int, side: str, is_minimum: bool) -> str:
    """Return the required images of a light sensor."""
    if count == 0:
        images = Sentence("no images")
    else:
        images = Sentence("1 image") if count == 1 else Sentence("%(count)s images", count=count)
    if is_minimum:
        images = Sentence("at least %(images)s", images=images)
    if side == "left":
        return Sentence("%(images)s of the left sensor", images=images)
    return Sentence("%(images)s of the right sensor", images=images)


def _describe_existing_count(count: int) -> str:
    if count == 0:
        return Sentence("there are none")
    return Sentence("there is 1") if count == 1 else Sentence("there are %(count)s", count=count)


@declare_judge(ImageLog)
def judge_image_log(criterion: ImageLog, trial: TrialResult) -> Outcome:
    """Judge the number and order of logged images of each light sensor, and the content of those at the start."""
    recording = trial.recording
    log = recording.image_log
    checks: list[Check] = []
    for side, count, minimum in (
        ("left", criterion.left, criterion.left_at_least),
        ("right", criterion.right, criterion.right_at_least),
    ):
        actual_count = sum(entry[0] == side for entry in log)
        message = Sentence(
            "Expected %(images)s to be logged, but %(actual)s.",
            images=_describe_images(minimum if count is None else count, side, count is None),
            actual=_describe_existing_count(actual_count),
        )
        if count is not None or minimum:
            share = (
                min(Fraction(actual_count, minimum), Fraction(1)) if count is None else Fraction(actual_count == count)
            )
            checks.append((share, message))
    if criterion.pairs:
        sides = [entry[0] for entry in log]
        is_alternating = bool(sides) and sides == ["left", "right"] * (len(sides) // 2)
        checks.append(
            (
                Fraction(is_alternating),
                Sentence("Expected left and right images to alternate, but they did not (image_data both)."),
            )
        )
    if criterion.at_start:
        moved_image = next((entry for entry in log if not _is_start_image(entry, recording, trial.light_noise)), None)
        problem_text = _describe_position(recording, moved_image[2]) if moved_image else Sentence("there is none")
        checks.append(
            (
                Fraction(bool(log) and moved_image is None),
                Sentence("Expected every image to be taken at the start pose, but %(problem)s.", problem=problem_text),
            )
        )
    if criterion.uniform is not None:
        side_images = [entry for entry in log if entry[0] == criterion.uniform]
        is_uniform = bool(side_images) and all(
            _is_uniform(entry[1]) and _has_content(entry, recording) for entry in side_images
        )
        checks.append(
            (
                Fraction(is_uniform),
                Sentence(
                    "Expected every image of the left sensor to be of one colour, but one is not or shows no label's "
                    "patch."
                )
                if criterion.uniform == "left"
                else Sentence(
                    "Expected every image of the right sensor to be of one colour, but one is not or shows no label's "
                    "patch."
                ),
            )
        )
    measures = (Measure(Sentence("images"), float(len(log))),)
    problem = next((words for reached, words in checks if reached < 1), None)
    if problem is None:
        message = (
            Sentence("The program logged 1 image as expected.")
            if len(log) == 1
            else Sentence("The program logged %(count)s images as expected.", count=len(log))
        )
        return pass_with(message, measures=measures)
    last_time = tick_to_seconds(recording, log[-1][2]) if log else None
    pose = None if last_time is None else get_pose_at(recording, last_time)
    score = sum((reached for reached, _ in checks), Fraction(0)) / len(checks)
    return fail_with(problem, last_time, pose, score if log else Fraction(0), measures)


def _measure_extremes(values: Sequence[float]) -> tuple[Measure, ...]:
    finite = [value for value in values if math.isfinite(value)]
    return (Measure(Sentence("least"), min(finite)), Measure(Sentence("most"), max(finite))) if finite else ()


def _check_datalog(criterion: Datalog, samples: Sequence[DatalogEntry], recording: Recording) -> list[Check]:
    """Return all checks except plateaus. The number of samples counts only if more than one is required."""
    name, count = criterion.series, len(samples)
    values = [datum.value for datum in samples]
    checks: list[Check] = []
    if criterion.at_least > 1:
        message = Sentence(
            "Expected at least %(least)s samples of %(name)s, but there are %(count)s",
            least=criterion.at_least,
            name=name,
            count=count,
        )
        checks.append((min(Fraction(count, criterion.at_least), Fraction(1)), message))
    if criterion.at_most is not None:
        message = Sentence(
            "Expected at most %(most)s samples of %(name)s, but there are %(count)s",
            most=criterion.at_most,
            name=name,
            count=count,
        )
        checks.append((Fraction(count <= criterion.at_most), message))
    if criterion.timed:
        timed_share = Fraction(sum(datum.simtime is not None for datum in samples), max(count, 1))
        message = Sentence(
            'Expected every sample of %(name)s to have its time ("%(name)s: 42 1.5"), but some have none', name=name
        )
        checks.append((timed_share, message))
    if criterion.between is not None:
        minimum, maximum = criterion.between
        strays = [value for value in values if not minimum <= value <= maximum]
        message = Sentence(
            "Expected %(name)s to stay between %(least)g and %(most)g, but it was %(value)s once",
            name=name,
            least=minimum,
            most=maximum,
            value=f"{strays[0]:g}" if strays else "",
        )
        checks.append((Fraction(count - len(strays), max(count, 1)), message))
    if criterion.covers is not None and values:
        low, high = criterion.covers
        message = Sentence(
            "Expected %(name)s to go from %(low)g to %(high)g, but it went from %(least)g to %(most)g",
            name=name,
            low=low,
            high=high,
            least=min(values),
            most=max(values),
        )
        checks.append((Fraction(min(values) <= low and max(values) >= high), message))
    if criterion.dips_below is not None:
        other_values = [datum.value for datum in recording.datalog if datum.name == criterion.dips_below]
        is_deeper = bool(other_values) and bool(values) and min(values) < min(other_values)
        message = Sentence(
            "Expected the lowest %(name)s to be below the lowest %(other)s, but it is not",
            name=name,
            other=criterion.dips_below,
        )
        checks.append((Fraction(is_deeper), message))
    return checks


def _check_plateaus(criterion: Datalog, values: Sequence[float]) -> Check:
    plateau_count, count = _count_ordered_plateaus(criterion, values), len(criterion.plateaus)
    template = (
        translatable(
            "Expected %(name)s to stay at %(values)s in this order, but after %(previous)g it never stayed at %(value)g"
        )
        if plateau_count
        else translatable("Expected %(name)s to stay at %(values)s in this order, but it never stayed at %(value)g")
    )
    message = Sentence(
        template,
        name=criterion.series,
        values=", ".join(f"{value:g}" for value in criterion.plateaus),
        previous=criterion.plateaus[plateau_count - 1],
        value=criterion.plateaus[min(plateau_count, count - 1)],
    )
    return Fraction(plateau_count, count), message


def _count_ordered_plateaus(criterion: Datalog, values: Sequence[float]) -> int:
    """Return how many of the plateaus come in order."""
    index = 0
    for plateau_count, plateau in enumerate(criterion.plateaus):
        run_length = 0
        while index < len(values) and run_length < criterion.plateau_samples:
            run_length = run_length + 1 if abs(values[index] - plateau) <= criterion.tolerance + 1e-9 else 0
            index += 1
        if run_length < criterion.plateau_samples:
            return plateau_count
    return len(criterion.plateaus)


def _is_start_image(entry: tuple[str, str, int], recording: Recording, noise: float) -> bool:
    """Return whether a logged image is the floor's crop at the start pose, within the noise of the light sensors."""
    floor = rebuild_floor(recording)
    if floor is None:
        pose = get_pose_after(recording, entry[2])
        return math.dist((pose.x, pose.y), (recording.start.x, recording.start.y)) < 1
    side, csv, _ = entry
    sensor_side: Side = "left" if side == "left" else "right"
    sensor = find_light_sensor(recording, sensor_side)
    expected = _crop_floor(floor, locate_footprint(recording, sensor_side, recording.start), sensor.diameter)
    actual = _parse_pixels(csv, sensor.diameter)
    if actual is None:
        return False
    mask = build_sensor_mask(sensor.diameter)
    return bool((np.abs(actual[mask] - expected[mask]) <= noise).all())


def _crop_floor(floor: Floor, footprint: Footprint, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Return the RGB under a sensor of that many pixels, shape (side, side, 3), black off the floor."""
    crop = np.zeros((side, side, 3), np.int64)
    top, left = max(footprint.row, 0), max(footprint.column, 0)
    bottom, right = min(footprint.row + side, HEIGHT), min(footprint.column + side, WIDTH)
    if top < bottom and left < right:
        window = (
            slice(top - footprint.row, bottom - footprint.row),
            slice(left - footprint.column, right - footprint.column),
        )
        crop[window] = floor.pixels[top:bottom, left:right]
    return crop


def _parse_pixels(csv: str, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]] | None:
    numbers = np.array([int(number) for number in csv.split(",") if number.isdecimal()], np.int64)
    return numbers.reshape(side, side, 4)[:, :, :3] if numbers.size == side * side * 4 else None


def _is_uniform(csv: str) -> bool:
    side = math.isqrt((csv.count(",") + 1) // 4)
    pixels = _parse_pixels(csv, side)
    return pixels is not None and bool((np.ptp(pixels[build_sensor_mask(side)], axis=0) == 0).all())


def _has_content(entry: tuple[str, str, int], recording: Recording) -> bool:
    """Return whether there was floor under the sensor and, on floors with label patches, a patch fills the image."""
    side, csv, tick = entry
    pose = get_pose_after(recording, tick)
    if measure_floor_share(recording, "left" if side == "left" else "right", pose) < 1:
        return False
    if side == "left" or recording.background not in GREYS or not recording.label_patches:
        return True
    pixels = bytes(map(int, csv.split(",")))
    image = Image(0.0, tick, pose, b"", pixels, -1, side=math.isqrt(len(pixels) // 4))
    return decode_label(image, GREYS[recording.background]) is not None


def _describe_position(recording: Recording, tick: int) -> str:
    pose = get_pose_after(recording, tick)
    return Sentence("one was taken at (%(x).1f, %(y).1f)", x=pose.x, y=pose.y)


#: The duration of a sensor reading, in seconds. A sample printed sooner after another repeats it.
_READING_SECONDS = 0.01


def _drop_repeats(samples: Sequence[DatalogEntry]) -> list[DatalogEntry]:
    """Return the samples without those printed sooner than a reading takes."""
    distinct_samples: list[DatalogEntry] = []
    for datum in samples:
        if not (distinct_samples and datum.t < distinct_samples[-1].t + _READING_SECONDS - 1e-9):
            distinct_samples.append(datum)
    return distinct_samples
