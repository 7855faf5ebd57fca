"""What whoever runs the installation sees: lanes, workers, what could not be graded, courses, and learning platforms.

Nothing of a grade is shown here.
"""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.doctor import examine_service
from service.language import translatable
from service.store import audit
from service.store.people import people, sign_in_links
from service.store.queue import batch_control, dead_letters, tryouts, workers
from service.store.queue.metrics import collect
from service.store.states import JobState, Lane
from service.version import GRADER_VERSION
from service.web.access import Operating
from service.web.context import Context, WebContext
from service.web.made_links import LinkWord, made_link, new_word, secret_word
from service.web.rendering import page, wants_part
from sim.errors import UsageError
from submissions.people import Student

router = APIRouter()
_LANES = {
    Lane.INTERACTIVE: translatable("interactive: single submissions, that somebody waits for"),
    Lane.BATCH: translatable("batch: whole classes"),
}
_TRYOUTS = translatable("tryouts: programs that are run and not marked")


@router.get("/operator")
def operation(request: Request, reader: Operating, context: Context) -> Response:
    """How the service is: what waits, who works, what could not be graded."""
    template = "operator_state.html" if wants_part(request) else "operator.html"
    return page(request, reader, template, **_state(context))


@router.post("/operator/retry")
def retry(reader: Operating, context: Context, batch_id: Annotated[str, Form(max_length=20)] = "") -> Response:
    """Queue again what could not be graded, of one batch or of all."""
    retried = batch_control.retry(context.store, batch_id or None, actor=reader.actor)
    # The lane of each is its own; a notice too many does no harm.
    for lane in Lane:
        context.notifier.grade(lane, retried.queued)
    return RedirectResponse("/operator", 303)


@router.get("/operator/courses")
def courses(request: Request, reader: Operating, context: Context, link: LinkWord = "") -> Response:
    """The courses, a form for an instructor of one, and the link that was made for the newest."""
    with context.store.reading() as session:
        made = made_link(session, request, context, reader, link)
        return page(request, reader, "operator_courses.html", courses=people.courses(session), made=made)


@router.post("/operator/courses")
def add_instructor(
    reader: Operating,
    context: Context,
    course: Annotated[str, Form(min_length=1, max_length=100)],
    who: Annotated[str, Form(min_length=1, max_length=100)],
    name: Annotated[str, Form(max_length=200)] = "",
) -> Response:
    """Make an instructor, and the course where there is none of that name; their link is shown to whoever made it."""
    if not course.strip() or not who.strip():
        raise UsageError("a course and its instructor need a name that can be seen")
    word = new_word()
    with context.store.transaction() as session:
        member = people.make_instructor(session, course.strip(), Student(who.strip(), name.strip()))
        audit.note(session, reader.actor, "add", "person", str(member.person_id), role=member.role.value)
        sign_in_links.make_link(session, member.person_id, reader.actor, word=secret_word(reader, word))
    return RedirectResponse(f"/operator/courses?link={word}", 303)


def _state(context: WebContext) -> dict[str, Any]:
    findings = examine_service(context.settings, context.store)
    with context.store.reading() as session:
        metrics = collect(session)
        quarantined = {each.worker: each for each in workers.in_quarantine(session)}
        dead = dead_letters.dead_letters(session)
        count = dead_letters.count(session)
        tried = tryouts.lane(session)
    lanes = [
        (
            _LANES[lane],
            metrics.jobs.get((lane, JobState.QUEUED), 0),
            metrics.jobs.get((lane, JobState.RUNNING), 0),
            round(metrics.oldest_seconds.get(lane, 0.0)),
        )
        for lane in Lane
    ]
    lanes.append((_TRYOUTS, tried.queued, tried.running, round(tried.oldest_seconds)))
    return {
        "findings": findings,
        "lanes": lanes,
        "metrics": metrics,
        "quarantined": quarantined,
        "dead": dead,
        "dead_count": count,
        "version": GRADER_VERSION,
    }
