"""Seeds of gradings: which secret a stored grade needs."""

from __future__ import annotations

import pytest

from submissions.seeds import PUBLIC_SECRET, Secret, choose_secret

pytestmark = pytest.mark.fast


def test_a_grade_needs_the_own_secret_or_none_or_one_of_another_installation() -> None:
    own = Secret("own")
    assert choose_secret(own.sha256, own) == own
    assert choose_secret(PUBLIC_SECRET.sha256, own) == PUBLIC_SECRET
    assert choose_secret(Secret("other").sha256, own) is None
