"""Hints on agents: an agent that returns nothing, or a text where an object is expected.

They compare the texts between agents with the criteria that lost marks.
"""

from __future__ import annotations

from collections.abc import Iterator

from service.grading.hint_clues import Clues, Listing
from service.grading.hint_code import Statement
from service.grading.hint_functions import describe_missing_return
from service.grading.judging.message_parts import quote_text
from service.language import translatable
from sim.sentences import Sentence
from submissions.criteria.agent_pairs import AgentPairCriterion
from submissions.criteria.replies import Replies

_CONVERSIONS = frozenset({"int", "float"})


def hint_about_silent_agent(clues: Clues) -> Iterator[str]:
    """Yield a hint on an agent's function without a return, if a criterion looks at what it sends."""
    names = [name for each in clues.lost if isinstance(each, AgentPairCriterion) for name in each.agents]
    for name in dict.fromkeys(names):
        agent = _find_agent(name, clues)
        if agent is not None and not any(each.keyword == "return" for each in agent[0].code.list_body(agent[1])):
            yield describe_missing_return(*agent)
            return


def hint_about_unasked_agent(clues: Clues) -> Iterator[str]:
    """Yield a hint on a part that never asks the agent that it should ask, with the agent that it asks instead."""
    for criterion in clues.lost:
        pair = criterion.agents if isinstance(criterion, AgentPairCriterion) else ()
        listing = next((each for each in clues.texts if pair and each.name == f"{pair[0]}.py"), None)
        calls = [(each, call.name) for each in listing.code.statements for call in each.calls] if listing else []
        if listing is None or not calls or pair[1] not in clues.agents or pair[1] in {name for _, name in calls}:
            continue
        criteria = clues.definition.criteria if clues.definition is not None else ()
        pairs = [each.agents for each in criteria if isinstance(each, AgentPairCriterion)]
        allowed = {each[1] for each in pairs if each[:1] == pair[:1]}
        wrong = next(((each, name) for each, name in calls if name in clues.agents and name not in allowed), None)
        if wrong is not None:
            statement, name = wrong
            yield Sentence(
                "%(place)s asks %(agent)s; expected %(expected)s. Write %(expected)s(...) in place of %(agent)s(...)",
                place=listing.locate(statement.line),
                agent=name,
                expected=pair[1],
            )
        else:
            yield Sentence(
                "%(file)s never asks %(agent)s. Call %(agent)s(...) in it, and use what it returns",
                file=listing.name,
                agent=pair[1],
            )
        return


def hint_about_text_of_agent(clues: Clues) -> Iterator[str]:
    """Yield a hint on an agent that answers with the text of an object in place of the object."""
    for criterion in clues.lost:
        if not isinstance(criterion, Replies) or not criterion.agents:
            continue
        agent = _find_agent(criterion.agents[1], clues)
        question = next((each for each in criterion.expect if _is_answered_with_text(each, criterion, clues)), None)
        if agent is None or question is None:
            continue
        listing, head = agent
        conversions = [
            each for each in listing.code.list_body(head) if any(call.name in _CONVERSIONS for call in each.calls)
        ]
        line = conversions[0].line if len(conversions) == 1 else head.line
        template = (
            translatable(
                "%(place)s: %(agent)s answers %(question)s with a text; expected a list. Write ast.literal_eval(...), "
                "which makes the object from the text; int(...) reads numbers only"
            )
            if isinstance(criterion.expect[question], list)
            else translatable(
                "%(place)s: %(agent)s answers %(question)s with a text; expected a dictionary. Write "
                "ast.literal_eval(...), which makes the object from the text; int(...) reads numbers only"
            )
        )
        yield Sentence(template, place=listing.locate(line), agent=head.tokens[1], question=quote_text(question))
        return


def _is_answered_with_text(question: str, criterion: Replies, clues: Clues) -> bool:
    """Return whether a list or dictionary is expected for a question, and a text with the same content came."""
    if not isinstance(criterion.expect[question], list | dict):
        return False
    for recording in clues.recordings:
        messages = recording.agent_messages
        for answer in messages:
            asked = messages[answer.reply_to] if answer.reply_to is not None else None
            if (
                asked is not None
                and (asked.sender, asked.receiver) == criterion.agents
                and asked.text == question
                and answer.is_text
            ):
                return True
    return False


def _find_agent(name: str, clues: Clues) -> tuple[Listing, Statement] | None:
    """Return the head of an agent's function, or None."""
    for listing in clues.extra_listings if name in clues.agents else ():
        heads = [each for each in listing.code.list_functions() if each.tokens[1] == name]
        if listing.name == f"{name}.py" and heads:
            return listing, heads[0]
    return None
