"""Trains a student's model inside the walls, and asks it to name images that it has not seen.

The labels of those images never come here; whether the names are right is judged elsewhere.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from responders.conversation import Code
from responders.function_calls import Called, FunctionCall, Returned, call_functions
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from sim.recording import Fault, Verdict

#: Images are sent in frames; one with more than this many pixels takes no other.
_PIXELS_A_CALL = 30_000

Images = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class TrainingOrder:
    """A hand-in with ``function(images, labels)``; ``images`` and ``unseen`` are grey levels, (n, side, side)."""

    code: Code
    files: Mapping[str, bytes]
    function: str
    images: Images
    labels: Sequence[str]
    unseen: Images
    limits: ChildLimits
    output_bytes: int
    seed: int


@dataclass(frozen=True, slots=True)
class Trained:
    """What the model called each unseen image, None where it gave no name; what went wrong, if something did."""

    names: tuple[str | None, ...]
    fault: Fault | None
    walls: str
    output: str
    model: str = ""  # the type of what was trained


def train_and_name(order: TrainingOrder, sandboxes: Sandboxes, meter: JobMeter) -> Trained:
    """One child: the student's module is loaded, trained, and asked. The limits are for all of it together.

    Raises HostError when the machine, not the student, fails.
    """
    chunks = _chunks(order.unseen)
    calls = [
        FunctionCall("robomark_train", (order.function,)),
        *(FunctionCall("robomark_predict", (_encoded(chunk), chunk.shape[1])) for chunk in chunks),
    ]
    called = call_functions(
        replace(order.code, text=f"{order.code.text}\n\n\n{_harness()}"),
        {**order.files, "train.npz": _packed(order.images, order.labels)},
        calls,
        order.limits,
        order.output_bytes,
        sandboxes,
        order.seed,
        meter,
    )
    return _trained(called, chunks, order)


def _trained(called: Called, chunks: Sequence[Images], order: TrainingOrder) -> Trained:
    """The names, each checked: what comes from a student's process may be anything."""
    if called.fault is not None or not called.returned:
        return Trained((None,) * len(order.unseen), _in_their_file(called.fault, order), called.walls, called.output)
    training, *naming = called.returned
    names: list[str | None] = []
    fault = training.fault
    for chunk, returned in zip(chunks, naming, strict=True):
        named = _names(returned, len(chunk)) if training.fault is None else None
        names += named or [None] * len(chunk)
        if named is None and fault is None:
            fault = returned.fault or _bad_answer()
    model = training.value if isinstance(training.value, str) else ""
    return Trained(tuple(names), _in_their_file(fault, order), called.walls, called.output, model)


def _names(returned: Returned, count: int) -> list[str | None] | None:
    value = returned.value
    if isinstance(value, list) and len(value) == count and all(isinstance(name, str) for name in value):
        return list(value)
    return None


def _bad_answer() -> Fault:
    return Fault(
        0.0, Verdict.RESPONDER_ERROR, "responder", "the model's predict gave something that is no list of names"
    )


def _in_their_file(fault: Fault | None, order: TrainingOrder) -> Fault | None:
    """Without a line number that points below the end of the student's own text."""
    if fault is None or fault.line is None or fault.line <= order.code.text.count("\n") + 1:
        return fault
    return replace(fault, line=None)


def _chunks(images: Images) -> list[Images]:
    each = max(1, _PIXELS_A_CALL // max(1, images.shape[1] * images.shape[2])) if len(images) else 1
    return [images[start : start + each] for start in range(0, len(images), each)]


def _encoded(images: Images) -> str:
    return base64.b64encode(np.ascontiguousarray(images).tobytes()).decode("ascii")


def _packed(images: Images, labels: Sequence[str]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, images=images, labels=np.asarray(list(labels), dtype=np.str_))
    return stream.getvalue()


def _harness() -> str:
    return resources.files("responders").joinpath("training_harness.py").read_text("utf-8")
