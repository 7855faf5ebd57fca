"""Evaluation of classifiers: accuracy on simulated sensor images, and its decline under harder conditions.

This module only measures. Tables and plots are made in ``service``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from models.cards import AccuracyResults, Card, CardCurve, Tally, load_card, load_weights
from models.images import LabelledPose, Photographer, Shift
from models.networks import Network, load_network
from models.preprocessing import Grey, compute_features
from models.tasks import Task, load_tasks

Axis = Literal["x", "y", "heading", "noise"]

_LIGHT_NOISES: tuple[float, ...] = (0, 10, 32, 64, 96, 128)
_MILLIMETRES: tuple[float, ...] = (-6, -4, -3, -2, -1, 0, 1, 2, 3, 4, 6)
_DEGREES: tuple[float, ...] = (-8, -5, -3, -2, -1, -0.5, 0, 0.5, 1, 2, 3, 5, 8)


@dataclass(frozen=True, slots=True)
class ClassifiedImage:
    """One test image: its place, true class and predicted class."""

    place: LabelledPose
    noise: float
    grey: Grey
    answer: int

    @property
    def right(self) -> bool:
        """Return whether the prediction is correct."""
        return self.answer == self.place.label


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A new measurement beside the card; ``answered`` holds the images of the confusion matrix."""

    card: Card
    measured: AccuracyResults
    answered: tuple[ClassifiedImage, ...]


def evaluate(name: str) -> Evaluation:
    """Run the packaged classifier over its whole test.

    Raises:
        UsageError: No classifier has this name.
    """
    card = load_card(name)
    results, classified_images = measure(load_tasks()[name], load_network(card.file, load_weights(name)))
    return Evaluation(card, results, classified_images)


def measure(task: Task, network: Network) -> tuple[AccuracyResults, tuple[ClassifiedImage, ...]]:
    """Run the whole test of ``task`` and return the results and the images that count for its accuracy."""
    with Photographer() as photographer:
        classified_images = tuple(_classify_test_images(task, network, photographer))
        curves = tuple(_measure_curves(task, network, photographer))
    confusion = np.zeros((len(task.classes), len(task.classes)), np.int64)
    for image in classified_images:
        confusion[image.place.label, image.answer] += 1
    table = tuple(tuple(int(count) for count in row) for row in confusion)
    return AccuracyResults(Tally(int(np.trace(confusion)), len(classified_images)), table, curves), classified_images


def _classify_test_images(task: Task, network: Network, photographer: Photographer) -> Iterator[ClassifiedImage]:
    test = task.test()
    for noise, draws in test.noises:
        photographs = list(photographer.draws(test.places, Shift(noise=noise), "accuracy", draws))
        answers = network.predict(np.array([compute_features(grey, task.side) for _, grey in photographs]))
        for (place, grey), answer in zip(photographs, answers, strict=True):
            yield ClassifiedImage(place, noise, grey, int(answer))


def _measure_curves(task: Task, network: Network, photographer: Photographer) -> Iterator[CardCurve]:
    headings = ("light noise", "grey levels either way", "on the spot")
    yield _measure_curve(task, network, photographer, headings, _LIGHT_NOISES, Shift(), "noise")
    sweeps: tuple[tuple[str, str, tuple[float, ...], Axis], ...] = (
        ("offset in x", "mm", _MILLIMETRES, "x"),
        ("offset in y", "mm", _MILLIMETRES, "y"),
        ("heading", "degrees", _DEGREES, "heading"),
    )
    for varied, unit, values, axis in sweeps:
        for noise in task.test().noises_beside:
            headings = (varied, unit, f"light noise {noise:g}" if noise else "no noise")
            yield _measure_curve(task, network, photographer, headings, values, Shift(noise=noise), axis)
    for altered in task.test().altered:
        tallies = tuple(_count_correct(task, network, list(altered.seen(value))) for value in altered.values)
        yield CardCurve(altered.varied, altered.unit, altered.under, altered.values, tallies)


def _measure_curve(
    task: Task,
    network: Network,
    photographer: Photographer,
    headings: tuple[str, str, str],
    values: Sequence[float],
    base_shift: Shift,
    axis: Axis,
) -> CardCurve:
    test = task.test()
    tallies = []
    for value in values:
        photographs = photographer.draws(test.swept, replace(base_shift, **{axis: value}), "curve", test.draws)
        tallies.append(_count_correct(task, network, [(place.label, grey) for place, grey in photographs]))
    return CardCurve(*headings, tuple(float(value) for value in values), tuple(tallies))


def _count_correct(task: Task, network: Network, examples: Sequence[tuple[int, Grey]]) -> Tally:
    answers = network.predict(np.array([compute_features(grey, task.side) for _, grey in examples]))
    correct = sum(label == answer for (label, _), answer in zip(examples, answers, strict=True))
    return Tally(int(correct), len(examples))
