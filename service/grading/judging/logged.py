"""Judging of logged data: datalog series, and images.

Images and readings come from the simulator's recording. Values are those the program printed, so they may be invented.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from service.grading.grade import Measure, TrialResult
from service.grading.judging.geometry import Side, floor_share, footprint_at, light_of
from service.grading.judging.judges import judges
from service.grading.judging.label_patches import GREYS, decoded
from service.grading.judging.outcome import Outcome, failed, passed
from service.grading.judging.precision import Strays, tempered
from service.grading.judging.readings import were_read
from sim.camera import HEIGHT, WIDTH, sensor_mask
from sim.floors import Floor
from sim.light_sensors import Footprint
from sim.recorded import floor_of, pose_after, pose_at, seconds_at
from sim.recording import Datum, Image, Recording
from submissions.criteria.logged import Datalog, ImageLog

Check = tuple[Fraction, str]  # the fraction reached, and the message if it is below 1


@judges(Datalog)
def judge_datalog(criterion: Datalog, trial: TrialResult) -> Outcome:
    """Judge the samples of one datalog series; if required, only those that a sensor read."""
    recording = trial.recording
    name = criterion.series
    logged = [datum for datum in recording.datalog if datum.name == name]
    true = _true_ones(criterion, logged, recording)
    samples = true if criterion.measured is None else _without_repeats(true)
    made_up = len(logged) - len(true)
    values = [datum.value for datum in samples]
    measures = (Measure("samples", float(len(values))), *_extremes(values))
    if criterion.measured is not None:
        measures += (Measure("made up", float(made_up)),)
    if logged and not values:
        return failed(
            f"Expected {name} to be readings of {_instrument(criterion)}, but all {len(logged)} samples are made up: "
            "none matches the reading at the time of printing.",
            measures=measures,
        )
    if not values and (criterion.at_least or criterion.plateaus or criterion.between or criterion.covers):
        return failed(
            f'Expected the program to log {name}, but the datalog has none: no line like "{name}: 42" was printed.'
        )
    checks = _datalog_checks(criterion, samples, recording)
    if criterion.plateaus:
        checks.append(_plateau_check(criterion, values))
    wrong = next((words for reached, words in checks if reached < 1), None)
    told = f"; {made_up} of {len(logged)} are made up, not readings of {_instrument(criterion)}" if made_up else ""
    if wrong is None:
        outcome = passed(f"The program logged {len(values)} samples of {name} as expected{told}.", measures=measures)
    else:
        score = sum((reached for reached, _ in checks), Fraction(0)) / len(checks)
        outcome = failed(f"{wrong}{told}.", score=score, measures=measures)
    return tempered(outcome, criterion, max(len(samples), 1), Strays("so much of the log is made up", made_up))


def _instrument(criterion: Datalog) -> str:
    name = criterion.measured or ""
    return f"the {name} sensor" if name in ("left light", "right light", "ultrasonic") else f"the {name}"


def _true_ones(criterion: Datalog, logged: Sequence[Datum], recording: Recording) -> list[Datum]:
    """Return the samples that the instrument read; all if the criterion names none."""
    if criterion.measured is None:
        return list(logged)
    values, at = [datum.value for datum in logged], [datum.t for datum in logged]
    read = were_read(values, at, (criterion.measured,), recording)
    return [datum for datum, true in zip(logged, read.tolist(), strict=True) if true]


def _images(count: int) -> str:
    return f"{count or 'no'} image{'' if count == 1 else 's'}"


def _there(count: int) -> str:
    return f"there {'is' if count == 1 else 'are'} {count or 'none'}"


@judges(ImageLog)
def judge_image_log(criterion: ImageLog, trial: TrialResult) -> Outcome:
    """Judge the number and order of logged images of each light sensor, and the content of those at the start."""
    recording = trial.recording
    log = recording.image_log
    checks: list[Check] = []
    for side, count, least in (
        ("left", criterion.left, criterion.left_at_least),
        ("right", criterion.right, criterion.right_at_least),
    ):
        got = sum(entry[0] == side for entry in log)
        asked = f"at least {_images(least)}" if count is None else _images(count)
        words = f"Expected {asked} of the {side} sensor to be logged, but {_there(got)}"
        if count is not None or least:
            reached = min(Fraction(got, least), Fraction(1)) if count is None else Fraction(got == count)
            checks.append((reached, words))
    if criterion.pairs:
        sides = [entry[0] for entry in log]
        turns = bool(sides) and sides == ["left", "right"] * (len(sides) // 2)
        checks.append(
            (Fraction(turns), "Expected left and right images to alternate, but they did not (image_data both)")
        )
    if criterion.at_start:
        moved = next((entry for entry in log if not _shows_start(entry, recording, trial.light_noise)), None)
        where = _where(recording, moved[2]) if moved else ""
        checks.append(
            (
                Fraction(bool(log) and moved is None),
                f"Expected every image to be taken at the start pose, but {where or 'there is none'}",
            )
        )
    if criterion.uniform is not None:
        own = [entry for entry in log if entry[0] == criterion.uniform]
        flat = bool(own) and all(_is_uniform(entry[1]) and _shows_something(entry, recording) for entry in own)
        checks.append(
            (
                Fraction(flat),
                f"Expected every image of the {criterion.uniform} sensor to be of one colour, but one is not "
                "or shows no label's patch",
            )
        )
    measures = (Measure("images", float(len(log))),)
    wrong = next((words for reached, words in checks if reached < 1), None)
    if wrong is None:
        return passed(
            f"The program logged {len(log)} {'image' if len(log) == 1 else 'images'} as expected.", measures=measures
        )
    last = seconds_at(recording, log[-1][2]) if log else None
    pose = None if last is None else pose_at(recording, last)
    held = sum((reached for reached, _ in checks), Fraction(0)) / len(checks)
    return failed(f"{wrong}.", last, pose, held if log else Fraction(0), measures)


def _extremes(values: Sequence[float]) -> tuple[Measure, ...]:
    finite = [value for value in values if math.isfinite(value)]
    return (Measure("least", min(finite)), Measure("most", max(finite))) if finite else ()


def _datalog_checks(criterion: Datalog, samples: Sequence[Datum], recording: Recording) -> list[Check]:
    """Return all checks except plateaus. The number of samples counts only if more than one is required."""
    name, count = criterion.series, len(samples)
    values = [datum.value for datum in samples]
    checks: list[Check] = []
    if criterion.at_least > 1:
        words = f"Expected at least {criterion.at_least} samples of {name}, but there are {count}"
        checks.append((min(Fraction(count, criterion.at_least), Fraction(1)), words))
    if criterion.at_most is not None:
        most = criterion.at_most
        checks.append((Fraction(count <= most), f"Expected at most {most} samples of {name}, but there are {count}"))
    if criterion.timed:
        timed = Fraction(sum(datum.simtime is not None for datum in samples), max(count, 1))
        checks.append(
            (timed, f'Expected every sample of {name} to have its time ("{name}: 42 1.5"), but some have none')
        )
    if criterion.between is not None:
        least, greatest = criterion.between
        strays = [value for value in values if not least <= value <= greatest]
        stray = f"{strays[0]:g}" if strays else ""
        words = f"Expected {name} to stay between {least:g} and {greatest:g}, but it was {stray} once"
        checks.append((Fraction(count - len(strays), max(count, 1)), words))
    if criterion.covers is not None and values:
        low, high = criterion.covers
        words = f"Expected {name} to go from {low:g} to {high:g}, but it went from {min(values):g} to {max(values):g}"
        checks.append((Fraction(min(values) <= low and max(values) >= high), words))
    if criterion.dips_below is not None:
        others = [datum.value for datum in recording.datalog if datum.name == criterion.dips_below]
        deeper = bool(others) and bool(values) and min(values) < min(others)
        words = f"Expected the lowest {name} to be below the lowest {criterion.dips_below}, but it is not"
        checks.append((Fraction(deeper), words))
    return checks


def _plateau_check(criterion: Datalog, values: Sequence[float]) -> Check:
    found, count = _plateaus_in_order(criterion, values), len(criterion.plateaus)
    series = ", ".join(f"{value:g}" for value in criterion.plateaus)
    before = f"after {criterion.plateaus[found - 1]:g} " if found else ""
    missing = criterion.plateaus[min(found, count - 1)]
    words = f"Expected {criterion.series} to stay at {series} in this order, but {before}it never stayed at {missing:g}"
    return Fraction(found, count), words


def _plateaus_in_order(criterion: Datalog, values: Sequence[float]) -> int:
    """Return how many of the plateaus come in order."""
    place = 0
    for found, wanted in enumerate(criterion.plateaus):
        run = 0
        while place < len(values) and run < criterion.plateau_samples:
            run = run + 1 if abs(values[place] - wanted) <= criterion.tolerance + 1e-9 else 0
            place += 1
        if run < criterion.plateau_samples:
            return found
    return len(criterion.plateaus)


def _shows_start(entry: tuple[str, str, int], recording: Recording, noise: float) -> bool:
    """Return whether a logged image is the floor's crop at the start pose, within the noise of the light sensors."""
    floor = floor_of(recording)
    if floor is None:
        pose = pose_after(recording, entry[2])
        return math.dist((pose.x, pose.y), (recording.start.x, recording.start.y)) < 1
    side, csv, _ = entry
    which: Side = "left" if side == "left" else "right"
    sensor = light_of(recording, which)
    expected = _crop(floor, footprint_at(recording, which, recording.start), sensor.diameter)
    found = _pixels(csv, sensor.diameter)
    if found is None:
        return False
    mask = sensor_mask(sensor.diameter)
    return bool((np.abs(found[mask] - expected[mask]) <= noise).all())


def _crop(floor: Floor, where: Footprint, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Return the RGB under a sensor of that many pixels, shape (side, side, 3), black off the floor."""
    crop = np.zeros((side, side, 3), np.int64)
    top, left = max(where.row, 0), max(where.column, 0)
    bottom, right = min(where.row + side, HEIGHT), min(where.column + side, WIDTH)
    if top < bottom and left < right:
        place = (slice(top - where.row, bottom - where.row), slice(left - where.column, right - where.column))
        crop[place] = floor.pixels[top:bottom, left:right]
    return crop


def _pixels(csv: str, side: int) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]] | None:
    numbers = np.array([int(number) for number in csv.split(",") if number.isdecimal()], np.int64)
    return numbers.reshape(side, side, 4)[:, :, :3] if numbers.size == side * side * 4 else None


def _is_uniform(csv: str) -> bool:
    side = math.isqrt((csv.count(",") + 1) // 4)
    pixels = _pixels(csv, side)
    return pixels is not None and bool((np.ptp(pixels[sensor_mask(side)], axis=0) == 0).all())


def _shows_something(entry: tuple[str, str, int], recording: Recording) -> bool:
    """Return whether there was floor under the sensor and, on floors with label patches, a patch fills the image."""
    side, csv, tick = entry
    pose = pose_after(recording, tick)
    if floor_share(recording, "left" if side == "left" else "right", pose) < 1:
        return False
    if side == "left" or recording.background not in GREYS or not recording.label_patches:
        return True
    pixels = bytes(map(int, csv.split(",")))
    image = Image(0.0, tick, pose, b"", pixels, -1, side=math.isqrt(len(pixels) // 4))
    return decoded(image, GREYS[recording.background]) is not None


def _where(recording: Recording, tick: int) -> str:
    pose = pose_after(recording, tick)
    return f"one was taken at ({pose.x:.1f}, {pose.y:.1f})"


#: The duration of a sensor reading, in seconds. A sample printed sooner after another repeats it.
_READING = 0.01


def _without_repeats(samples: Sequence[Datum]) -> list[Datum]:
    """Return the samples without those printed sooner than a reading takes."""
    found: list[Datum] = []
    for datum in samples:
        if not (found and datum.t < found[-1].t + _READING - 1e-9):
            found.append(datum)
    return found
