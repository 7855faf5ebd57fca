"""Sentences on the mildest conditions with which a trial still fails, and the next steps for conditions."""

from __future__ import annotations

from collections.abc import Sequence

from service.grading.reruns.engine import Rerun
from service.grading.reruns.mildest import Conditions, ScaledConditions
from service.language import translatable
from sim.sentences import Sentence, join_with_and

RESEND_STEP = translatable("Send a message again if its answer does not arrive, then submit again.")
NOISE_STEP = translatable("Make your program work with noise: decide by more than one reading, then submit again.")
CONDITIONS_STEP = translatable("Make your program work under these conditions, then submit again.")
START_STEP = translatable("Make your program independent of the start pose, then submit again.")


def describe_mildest(reruns: Sequence[Rerun], criterion: str) -> str:
    """Return the conditions of a rerun that passes and of the next harder one, which fails; empty for other reruns."""
    passing, failing = reruns
    if not passing.passes(criterion) or not failing.loses(criterion):
        return ""
    values = zip(
        _describe_values(_get_exchange(passing).conditions),
        _describe_values(_get_exchange(failing).conditions),
        strict=True,
    )
    changes = [(easier, harder) for easier, harder in values if easier != harder]
    if not changes:
        return ""
    return Sentence(
        "With %(easier)s, one failed trial passes; with %(harder)s, it fails.",
        easier=join_with_and([easier for easier, _ in changes]),
        harder=join_with_and([harder for _, harder in changes]),
    )


def describe_mildest_step(reruns: Sequence[Rerun]) -> str:
    """Return what the student does next: about the one condition that changes, or about all of them."""
    exchange = _get_exchange(reruns[0])
    easy, hard = exchange.easy, exchange.hard
    steps: list[str] = []
    if easy.pose != hard.pose:
        steps.append(START_STEP)
    if (easy.light_noise, easy.motor_noise) != (hard.light_noise, hard.motor_noise):
        steps.append(NOISE_STEP)
    if easy.loss != hard.loss:
        steps.append(RESEND_STEP)
    return Sentence(steps[0] if len(steps) == 1 else CONDITIONS_STEP)


def _get_exchange(rerun: Rerun) -> ScaledConditions:
    return next(each for each in rerun.exchanges if isinstance(each, ScaledConditions))


def _describe_values(conditions: Conditions) -> tuple[str, ...]:
    pose = conditions.pose
    return (
        Sentence("a light noise of %(level)s", level=_format_level(conditions.light_noise)),
        Sentence("a motor noise of %(level)s", level=_format_level(conditions.motor_noise)),
        Sentence("a message loss of %(percent)s %%", percent=_format_level(100 * conditions.loss)),
        Sentence(
            "a start at x %(x)s, y %(y)s, heading %(heading)s degrees",
            x=_format_level(pose.x),
            y=_format_level(pose.y),
            heading=_format_level(pose.heading),
        ),
    )


def _format_level(level: float) -> str:
    return f"{round(level, 2):.12g}"
