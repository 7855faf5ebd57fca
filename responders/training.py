"""Trains a student's model in the sandbox and lets it classify unseen images.

The labels of those images are not available here. The predictions are judged elsewhere.
"""

from __future__ import annotations

import base64
import io
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from responders.function_calls import CallResult, CallResults, FunctionCall, call_functions
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from responders.source_file import SourceFile
from sim.recording import Fault, Verdict

#: Maximum number of pixels per frame. A larger image is sent alone.
_MAX_CALL_PIXELS = 30_000

Images = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class TrainingSpec:
    """A submission with ``function(images, labels)``, and the images as grey levels of shape (n, side, side).

    The groups of ``unseen`` are predicted in order, so the output for one group depends on no later group.
    """

    code: SourceFile
    files: Mapping[str, bytes]
    function: str
    images: Images
    labels: Sequence[str]
    unseen: Sequence[Images]
    limits: ChildLimits
    output_bytes: int
    seed: int


@dataclass(frozen=True, slots=True)
class Predictions:
    """The predicted label of each image of a group, or None where the model gave no valid one.

    ``fault``, ``output`` and ``notes`` are those up to the end of the group.
    """

    names: tuple[str | None, ...]
    fault: Fault | None
    output: str
    notes: tuple[str, ...] = ()


def train_and_predict(spec: TrainingSpec, sandboxes: Sandboxes, meter: JobMeter) -> tuple[Predictions, ...]:
    """Train the student's model in one child and return its predictions for each group of images.

    The limits apply to loading, training and prediction together.

    Raises:
        HostError: If the machine fails, not the student's code.
    """
    groups = [_split_images(images) for images in spec.unseen]
    calls = [
        FunctionCall("robomark_train", (spec.function,)),
        *(
            FunctionCall("robomark_predict", (_encode_images(chunk), chunk.shape[1]))
            for group in groups
            for chunk in group
        ),
    ]
    call_results = call_functions(
        replace(spec.code, text=f"{spec.code.text}\n\n\n{_load_harness()}"),
        {**spec.files, "train.npz": _pack_training_file(spec.images, spec.labels)},
        calls,
        spec.limits,
        spec.output_bytes,
        sandboxes,
        spec.seed,
        meter,
    )
    return tuple(_collect_predictions(call_results, groups, spec))


def _collect_predictions(
    call_results: CallResults, groups: Sequence[Sequence[Images]], spec: TrainingSpec
) -> Iterator[Predictions]:
    """Yield the predictions of each group, validated because they are untrusted."""
    fault = call_results.fault or (call_results.returned[0].fault if call_results.returned else None)
    is_trained, end = fault is None, 1
    for group in groups:
        names: list[str | None] = []
        for chunk, call_result in zip(group, call_results.returned[end:], strict=False):
            chunk_labels = _parse_labels(call_result, len(chunk)) if is_trained else None
            if chunk_labels is None and fault is None:
                fault = call_result.fault or _build_invalid_prediction_fault()
            names += chunk_labels or [None] * len(chunk)
        end += len(group)
        missing_count = sum(map(len, group)) - len(names)
        output = "\n".join(itertools.chain.from_iterable(call_results.printed[: end + 1]))
        notes = call_results.notes[: end + 1][-1]
        yield Predictions((*names, *[None] * missing_count), _drop_harness_line(fault, spec), output, notes)


def _parse_labels(call_result: CallResult, count: int) -> list[str | None] | None:
    value = call_result.value
    if isinstance(value, list) and len(value) == count and all(isinstance(name, str) for name in value):
        return list(value)
    return None


def _build_invalid_prediction_fault() -> Fault:
    return Fault(
        0.0, Verdict.RESPONDER_ERROR, "responder", "the model's predict gave something that is no list of names"
    )


def _drop_harness_line(fault: Fault | None, spec: TrainingSpec) -> Fault | None:
    """Return the fault without a line number that is beyond the end of the student's own text."""
    if fault is None or fault.line is None or fault.line <= spec.code.text.count("\n") + 1:
        return fault
    return replace(fault, line=None)


def _split_images(images: Images) -> list[Images]:
    chunk_size = max(1, _MAX_CALL_PIXELS // max(1, images.shape[1] * images.shape[2])) if len(images) else 1
    return [images[start : start + chunk_size] for start in range(0, len(images), chunk_size)]


def _encode_images(images: Images) -> str:
    return base64.b64encode(np.ascontiguousarray(images).tobytes()).decode("ascii")


def _pack_training_file(images: Images, labels: Sequence[str]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, images=images, labels=np.asarray(list(labels), dtype=np.str_))
    return stream.getvalue()


def _load_harness() -> str:
    return resources.files("responders").joinpath("training_harness.py").read_text("utf-8")
