"""The stages of regrades in words, for pages, commands and the API."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from service.language import translatable
from service.store.states import ChangeStage

STAGE_LABELS: Mapping[ChangeStage, str] = MappingProxyType(
    {
        ChangeStage.FIRST_GRADE: translatable("had no grade"),
        ChangeStage.CRITERIA: translatable("criteria changed"),
        ChangeStage.JUDGING: translatable("judging changed"),
        ChangeStage.SIMULATOR: translatable("simulator changed"),
        ChangeStage.SECRET: translatable("secret changed"),
        ChangeStage.ASSIGNMENT: translatable("assignment changed"),
        ChangeStage.POOL: translatable("other trials of the pool"),
        ChangeStage.WORKER: translatable("earlier worker graded wrongly"),
        ChangeStage.UNEXPLAINED: translatable("unexplained"),
    }
)
#: Of regrades with equal marks.
NOTHING_CHANGED = translatable("nothing changed")
SAME_MARKS = translatable("same marks")
STAGE_MEANINGS: Mapping[ChangeStage, str] = MappingProxyType(
    {
        ChangeStage.FIRST_GRADE: translatable("The submission could not be graded before."),
        ChangeStage.CRITERIA: translatable("The criteria of the new version give the stored runs other marks."),
        ChangeStage.JUDGING: translatable("The installed release judges the stored runs differently."),
        ChangeStage.SIMULATOR: translatable(
            "The same trials went differently with the installed simulator, kit and libraries."
        ),
        ChangeStage.SECRET: translatable(
            "The secret of the installation changed, and with it the random values of trials."
        ),
        ChangeStage.ASSIGNMENT: translatable("The new version of the assignment has other trials, limits or files."),
        ChangeStage.POOL: translatable("The two gradings ran a different number of trials of a pool."),
        ChangeStage.WORKER: translatable("The worker of the earlier grade was found to grade wrongly."),
        ChangeStage.UNEXPLAINED: translatable(
            "Assignment and release are the same. The program may depend on outside values. Verify both grades."
        ),
    }
)
#: The parts of an assignment that can differ.
PART_LABELS: Mapping[str, str] = MappingProxyType(
    {
        "world": translatable("world"),
        "parts": translatable("parts"),
        "limits": translatable("limits"),
        "given": translatable("given files"),
        "given_parts": translatable("given programs"),
        "training": translatable("training"),
        "scenarios": translatable("scenarios"),
        "secret": translatable("seeds of hidden scenarios"),
    }
)


def describe_stages(stages: Sequence[ChangeStage], changed_parts: Sequence[str]) -> str:
    """Return the stages in English, with the parts of the assignment that differ."""
    parts_note = f" ({', '.join(PART_LABELS[part] for part in changed_parts)})" if changed_parts else ""
    return ", ".join(STAGE_LABELS[stage] + (parts_note if stage is ChangeStage.ASSIGNMENT else "") for stage in stages)
