"""What whoever runs the installation sees: lanes, workers, what could not be graded, courses, and learning platforms.

Nothing of a grade is shown here.
"""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.doctor import examine_service
from service.store import audit, batch_control, credentials, dead_letters, people, workers
from service.store.credentials import LINK_LIFETIME
from service.store.metrics import collect
from service.store.states import CredentialKind, JobState, Lane
from service.version import GRADER_VERSION
from service.web.access import Operating
from service.web.context import Context, WebContext
from service.web.rendering import page, wants_part
from submissions.people import Student

router = APIRouter()


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
def courses(request: Request, reader: Operating, context: Context) -> Response:
    """The courses, and a form for an instructor of one."""
    with context.store.reading() as session:
        return page(request, reader, "operator_courses.html", courses=people.courses(session), link="", who="")


@router.post("/operator/courses")
def add_instructor(
    request: Request,
    reader: Operating,
    context: Context,
    course: Annotated[str, Form(min_length=1, max_length=100)],
    who: Annotated[str, Form(min_length=1, max_length=100)],
    name: Annotated[str, Form(max_length=200)] = "",
) -> Response:
    """Make an instructor, and the course where there is none of that name; their link is shown this once."""
    with context.store.transaction() as session:
        member = people.make_instructor(session, course.strip(), Student(who.strip(), name.strip()))
        secret = credentials.issue(session, member.person_id, CredentialKind.LINK, LINK_LIFETIME)
        audit.note(session, reader.actor, "add", "person", str(member.person_id), role=member.role.value)
        listed = people.courses(session)
    start = context.settings.public_url or str(request.base_url).rstrip("/")
    return page(
        request, reader, "operator_courses.html", courses=listed, link=f"{start}/sign-in/{secret}", who=member.id
    )


def _state(context: WebContext) -> dict[str, Any]:
    findings = examine_service(context.settings, context.store)
    with context.store.reading() as session:
        metrics = collect(session)
        quarantined = {each.worker: each for each in workers.in_quarantine(session)}
        dead = dead_letters.dead_letters(session)
        count = dead_letters.count(session)
    lanes = [
        (
            lane.value,
            metrics.jobs.get((lane, JobState.QUEUED), 0),
            metrics.jobs.get((lane, JobState.RUNNING), 0),
            round(metrics.oldest_seconds.get(lane, 0.0)),
        )
        for lane in Lane
    ]
    return {
        "findings": findings,
        "lanes": lanes,
        "metrics": metrics,
        "quarantined": quarantined,
        "dead": dead,
        "dead_count": count,
        "version": GRADER_VERSION,
    }
