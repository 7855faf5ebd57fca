"""The API compared with its own description: valid and invalid requests get a documented answer and no server error.

Slow; ``test_api.py`` tests single routes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, note, settings
from schemathesis.core.result import Ok
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi import checks

from builders import echo
from service.store.courses import open_assignments
from service.store.courses.assignment_versions import freeze_assignment
from web import Web, web_in
from web_world import make_world

pytestmark = [pytest.mark.long, pytest.mark.longest]
#: Excluded checks: we choose the path values and the caller, and the store may refuse requests that fit the
#: description.
_NOT_TOLD = [checks.ignored_auth, checks.positive_data_acceptance, checks.negative_data_rejection]
_EXAMPLES = settings(
    max_examples=6,
    deadline=None,
    database=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],
    suppress_health_check=list(HealthCheck),
)


@schemathesis.serializer("application/zip")
def _as_it_is(_context: Any, value: Any) -> bytes:
    return value if isinstance(value, bytes) else str(value).encode("utf-8", "replace")


@pytest.fixture(scope="module")
def described_api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Web, dict[str, Any], dict[str, str]]]:
    """Yield the application, the header of each kind of reader, and the path values."""
    with web_in(tmp_path_factory.mktemp("home"), api_calls_per_minute=1_000_000) as web:
        world = make_world(web)
        with web.store.transaction() as session:
            open_assignments.prepare_assignment(session, 1, freeze_assignment(echo()))
            open_assignments.open_for_students(session, 1, "echo-responder")
        # Fewest rights first: what one of them deletes, the next can no longer reach.
        members = {"student": world.ada, "instructor": world.grace, "operator": web.operator()}
        tokens = {who: web.token(member, "read", "submit", "mark", "manage") for who, member in members.items()}
        yield web, tokens, world.values


@pytest.mark.parametrize("mode", list(GenerationMode))
def test_every_answer_is_as_it_is_described(described_api: tuple[Web, Any, Any], mode: GenerationMode) -> None:
    """Every kind of reader sends the same requests, because generating one takes longer than answering it."""
    web, tokens, values = described_api
    schema = schemathesis.openapi.from_dict(web.app.openapi())
    schema.app = web.app
    for each in schema.get_all_operations():
        assert isinstance(each, Ok)
        _try(each.ok(), mode, tokens, values)


def _try(operation: Any, mode: GenerationMode, tokens: dict[str, dict[str, str]], values: dict[str, str]) -> None:
    @_EXAMPLES
    @given(case=operation.as_strategy(generation_mode=mode))
    def answers(case: Any) -> None:
        for name in case.path_parameters or {}:
            case.path_parameters[name] = values.get(name, case.path_parameters[name])
        for who, token in tokens.items():
            note(f"as {who}")
            # The default of 10 s can be too short while other processes compute.
            answer = case.call(base_url="http://localhost", headers=token, timeout=300)
            case.validate_response(answer, excluded_checks=_NOT_TOLD)

    answers()
