"""Grading of submissions that train a model: it learns from some trials' images and classifies the others'.

The robot runs first, recorded as usual. The model's answers are then added to the recordings, so they are judged like a
responder's.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from responders.sandbox.meter import JobMeter
from responders.training import Images, Predictions, TrainingSpec
from service.grading.grade import TrialResult
from service.grading.judging.collecting import ImagePair, collect_pairs
from service.grading.judging.label_patches import convert_to_grey
from service.grading.run_plan import RunPlan
from service.grading.trial_runner import TrialRunner
from sim.random_streams import RandomStream
from sim.recording import Fault, Image, Message, Recording, Verdict
from sim.sentences import Sentence
from submissions.assignment.definition import Training

_HINT = Sentence(
    "Your function is called once, with all images and labels; call it yourself with a few rows of numbers."
)
_COLLECT = Sentence('Log images while the robot stands over something, with print("image_data both").')
_SIDE = {"focus": 14, "whole": 20}


def add_model_answers(
    results: list[TrialResult], plan: RunPlan, training: Training, runner: TrialRunner, meter: JobMeter
) -> list[TrialResult]:
    """Train the model and return the trials, with its answers to the images of the test trials.

    Errors in training or classification are faults of every test trial.

    Raises:
        HostError: The machine failed.
        Exception: Whatever the meter's heartbeat raises.
    """
    trainer = plan.functions
    if trainer is None or not results:
        return results
    training_pairs = [
        pair for result in results if result.scenario in training.scenarios for pair in _collect_trial_pairs(result)
    ]
    labelled_pairs = [(pair, pair.truth) for pair in training_pairs if pair.truth is not None]
    test_indices = [index for index, result in enumerate(results) if result.scenario not in training.scenarios]
    # Hidden images come last, so that feedback on visible ones is fixed before the model sees hidden ones.
    visible = [index for index in test_indices if results[index].visibility == "visible"]
    groups = [group for group in (visible, [index for index in test_indices if index not in visible]) if group]
    images_by_group = [[pair for index in group for pair in _collect_trial_pairs(results[index])] for group in groups]
    # Not in track order, where neighbours mostly show the same label.
    chance = RandomStream(plan.child_seed, "order of images")
    orders = [sorted(range(len(images)), key=chance.integer) for images in images_by_group]
    if labelled_pairs:
        spec = TrainingSpec(
            trainer.code,
            trainer.files,
            training.function,
            _stack_images([pair for pair, _ in labelled_pairs], training),
            [truth for _, truth in labelled_pairs],
            [
                _stack_images([images[place] for place in order], training)
                for images, order in zip(images_by_group, orders, strict=True)
            ],
            trainer.limits,
            trainer.output_bytes,
            plan.child_seed,
        )
        predictions = runner.train(spec, meter)
    else:
        fault = _build_no_images_fault(len(training_pairs), plan)
        predictions = tuple(Predictions((None,) * len(images), fault, "") for images in images_by_group)
    answered_results = list(results)
    for group, order, group_predictions in zip(groups, orders, predictions, strict=True):
        names_by_place = dict(zip(order, group_predictions.names, strict=True))
        names = iter([names_by_place[place] for place in range(len(order))])
        for index in group:
            recording = _add_answers(
                results[index].recording, _collect_trial_pairs(results[index]), names, group_predictions
            )
            answered_results[index] = replace(results[index], recording=recording)
    return answered_results


def _build_no_images_fault(images: int, plan: RunPlan) -> Fault:
    """Return the fault of a run without training images. It is the student's only if the program is theirs."""
    sentence = (
        Sentence(
            "the robot collected %(count)s images, but none over a known label, so there is nothing to train on",
            count=images,
        )
        if images
        else Sentence("the robot collected no images, so there is nothing to train on")
    )
    if plan.assignment.parts.program != "student":
        return Fault(0.0, Verdict.ASSIGNMENT_ERROR, "assignment", sentence)
    return Fault(0.0, Verdict.PROGRAM_ERROR, "program", sentence, hint=_COLLECT)


def _collect_trial_pairs(result: TrialResult) -> list[ImagePair]:
    """Return a trial's images, logged and sent, in the order in which they were taken."""
    pairs = [*collect_pairs(result.recording, "log"), *collect_pairs(result.recording, "sent")]
    return sorted(pairs, key=lambda pair: pair.image.tick)


def _stack_images(pairs: Sequence[ImagePair], training: Training) -> Images:
    side = _SIDE[training.image]
    images = [convert_to_grey(pair.image, focus=training.image == "focus") for pair in pairs]
    return np.stack(images) if images else np.empty((0, side, side), np.uint8)


def _add_answers(
    recording: Recording, pairs: Sequence[ImagePair], names: Iterator[str | None], predictions: Predictions
) -> Recording:
    """Return the recording with each image as a message from the robot and each name as its answer."""
    messages: list[Message] = []
    images: list[Image] = []
    answer_names: list[str | None] = []
    for pair in pairs:
        image, name = pair.image, next(names)
        images.append(replace(image, message=len(messages), truth=pair.truth))
        messages.append(Message(image.t, "robot", "IMG_DATA", image.t))
        answer_names.append(name)
        if name is not None:
            messages.append(Message(image.t, "responder", name, image.t, len(messages) - 1))
    faults = recording.faults
    if predictions.fault is not None:
        fault = replace(predictions.fault, t=0.0, hint=predictions.fault.hint or _HINT)
        faults = tuple(sorted((*faults, fault), key=_get_fault_time))
    hash_input = f"{recording.sha256}:{json.dumps([answer_names, str(predictions.fault)])}"
    return replace(
        recording,
        messages=tuple(messages),
        images=tuple(images),
        faults=faults,
        verdict=faults[0].verdict if faults else Verdict.FINISHED,
        responder_output=predictions.output,
        notes=(*recording.notes, *predictions.notes),
        sha256=hashlib.sha256(hash_input.encode()).hexdigest(),
    )


def _get_fault_time(fault: Fault) -> float:
    return fault.t
