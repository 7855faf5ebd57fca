"""What every test may use: one warm rig a test process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from service.grading.rig import Rig

# Two cores are shared with whatever else runs: how long an example takes says nothing.
settings.register_profile("robomark", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("robomark")


@pytest.fixture(scope="session")
def rig() -> Iterator[Rig]:
    with Rig() as warm:
        yield warm
