"""A sentence for people that can still be said in another language: what it says, apart from what it says it of.

Which languages there are is the service's to know; written out here it is English.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Sentence:
    """``%(name)s`` in the template stands for a value, which may be a sentence too; without any it is as it stands."""

    template: str
    values: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.template % self.values if self.values else self.template


def listed(parts: Sequence[str | Sentence]) -> str | Sentence:
    """Those parts with "and" between them; empty for none."""
    *before, last = parts or ("",)
    return Sentence("%(these)s and %(last)s", {"these": listed(before), "last": last}) if before else last
