"""Trains a student's model inside the sandbox, and asks it to name images that it has not seen.

The labels of those images never come here; whether the names are right is judged elsewhere.
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

from responders.code import Code
from responders.function_calls import Called, FunctionCall, Returned, call_functions
from responders.sandbox.manager import Sandboxes
from responders.sandbox.meter import JobMeter
from responders.sandbox.running_child import ChildLimits
from sim.recording import Fault, Verdict

#: Images are sent in frames; one with more than this many pixels takes no other.
_PIXELS_A_CALL = 30_000

Images = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class TrainingSpec:
    """A submission with ``function(images, labels)``; images are grey levels, (n, side, side).

    The groups of ``unseen`` are named one after the other, so what is told of the first knows nothing of the next.
    """

    code: Code
    files: Mapping[str, bytes]
    function: str
    images: Images
    labels: Sequence[str]
    unseen: Sequence[Images]
    limits: ChildLimits
    output_bytes: int
    seed: int


@dataclass(frozen=True, slots=True)
class Named:
    """What the model called each image of a group, None where it gave no name.

    ``fault`` is what had gone wrong by then, ``output`` all that had been printed, ``notes`` all that had been noted.
    """

    names: tuple[str | None, ...]
    fault: Fault | None
    output: str
    notes: tuple[str, ...] = ()


def train_and_name(spec: TrainingSpec, sandboxes: Sandboxes, meter: JobMeter) -> tuple[Named, ...]:
    """One child: the student's module is loaded, trained, and asked. The limits are for all of it together.

    Raises HostError when the machine, not the student, fails.
    """
    groups = [_chunks(images) for images in spec.unseen]
    calls = [
        FunctionCall("robomark_train", (spec.function,)),
        *(FunctionCall("robomark_predict", (_encoded(chunk), chunk.shape[1])) for group in groups for chunk in group),
    ]
    called = call_functions(
        replace(spec.code, text=f"{spec.code.text}\n\n\n{_harness()}"),
        {**spec.files, "train.npz": _packed(spec.images, spec.labels)},
        calls,
        spec.limits,
        spec.output_bytes,
        sandboxes,
        spec.seed,
        meter,
    )
    return tuple(_named(called, groups, spec))


def _named(called: Called, groups: Sequence[Sequence[Images]], spec: TrainingSpec) -> Iterator[Named]:
    """The names, each checked: what comes from a student's process may be anything."""
    fault = called.fault or (called.returned[0].fault if called.returned else None)
    trained, end = fault is None, 1
    for group in groups:
        names: list[str | None] = []
        for chunk, returned in zip(group, called.returned[end:], strict=False):
            given = _names(returned, len(chunk)) if trained else None
            if given is None and fault is None:
                fault = returned.fault or _bad_answer()
            names += given or [None] * len(chunk)
        end += len(group)
        missing = sum(map(len, group)) - len(names)
        output = "\n".join(itertools.chain.from_iterable(called.printed[: end + 1]))
        notes = called.notes[: end + 1][-1]
        yield Named((*names, *[None] * missing), _in_their_file(fault, spec), output, notes)


def _names(returned: Returned, count: int) -> list[str | None] | None:
    value = returned.value
    if isinstance(value, list) and len(value) == count and all(isinstance(name, str) for name in value):
        return list(value)
    return None


def _bad_answer() -> Fault:
    return Fault(
        0.0, Verdict.RESPONDER_ERROR, "responder", "the model's predict gave something that is no list of names"
    )


def _in_their_file(fault: Fault | None, spec: TrainingSpec) -> Fault | None:
    """Without a line number that points below the end of the student's own text."""
    if fault is None or fault.line is None or fault.line <= spec.code.text.count("\n") + 1:
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
