"""What a token may do, in words. Which route needs which is said where the route is."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from service.language import translatable

#: By name; a token does what its owner may do, and of that what its scopes name.
SCOPES: Mapping[str, str] = MappingProxyType(
    {
        "read": translatable("read what its owner may see"),
        "submit": translatable("submit, for oneself as a student, or batches as an instructor"),
        "mark": translatable("override, comment, publish, regrade"),
        "manage": translatable("open assignments, set policies, enrol, delete"),
        "sign-in": translatable("sign a browser in"),
    }
)
