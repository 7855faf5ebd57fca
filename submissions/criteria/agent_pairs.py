"""Base class for criteria about messages and replies, which can also apply to a pair of agents.

This module defines no criterion.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Self

from pydantic import field_validator, model_validator

from submissions.criteria.common import AssignmentContext, Criterion, SomeTexts, UnmetRequirement
from submissions.strict_table import TableMistake

_ROBOT_OPTIONS = ("is_json", "path", "value", "json_queue", "queue_grows")
_RESPONDER = "responder"


class AgentPairCriterion(Criterion):
    """Option ``agents = ["agent", "parser"]``: judge the texts between two agents instead of those of the robot.

    Texts from the first agent to the second replace the robot's messages. Replies of the second replace the responder's
    answers. Either agent may be the responder.
    """

    agents: SomeTexts = ()

    @field_validator("agents")
    @classmethod
    def _check_pair(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if len(value) not in (0, 2) or len(set(value)) < len(value):
            raise ValueError("is not a pair, expected [sender, receiver]")
        return value

    @model_validator(mode="after")
    def _check_agent_options(self) -> Self:
        option = next((name for name in _ROBOT_OPTIONS if self.agents and getattr(self, name, None)), None)
        if option is not None:
            option_name = "json" if option == "json_queue" else option
            raise TableMistake(
                "agents", f"has {option_name} beside agents, expected conditions for the text (JSON for a list)"
            )
        return self

    def find_unmet_requirements(self, context: AssignmentContext) -> Iterator[UnmetRequirement]:
        """Yield a problem if one of the agents does not exist."""
        yield from super().find_unmet_requirements(context)
        agent_names = {_RESPONDER, *context.agents}
        for name in set(self.agents) - agent_names:
            expected_names = ", ".join(sorted(agent_names)) if context.agents else "an [agents] table with it"
            yield UnmetRequirement("agents", f'agents names "{name[:60]}", expected {expected_names}')
