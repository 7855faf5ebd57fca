"""The operator's pages: queues, workers, failed jobs, courses and instructors.

They show no contents of grades.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Form, Request
from fastapi.responses import RedirectResponse, Response

from service.language import Language, translatable
from service.operations import batches, people, system
from service.operations import courses as course_operations
from service.operations.courses import MemberRequest
from service.operations.types import JobQueue, JobState
from service.web.access import OperatorReader, RowNumberAfter, SentRowName
from service.web.context import Context
from service.web.created_links import LinkWord, derive_secret, find_created_link, generate_word
from service.web.language import detect_language
from service.web.rendering import is_htmx_request, render_page

if TYPE_CHECKING:
    from service.doctor import Finding

router = APIRouter()
_QUEUE_TITLES = {
    JobQueue.INTERACTIVE: translatable("interactive: single submissions"),
    JobQueue.BATCH: translatable("batch: whole classes"),
    JobQueue.COMPLETION: translatable("completion: the other trials of pools"),
}
_TEST_RUNS_TITLE = translatable("test runs: programs that run without marks")


@router.get("/operator")
def show_status(request: Request, reader: OperatorReader, context: Context) -> Response:
    """Show the system status: queues, workers and failed jobs."""
    view = system.show(context.service, reader.actor)
    lanes = [
        (
            _QUEUE_TITLES[lane],
            view.metrics.queue.jobs.get((lane, JobState.QUEUED), 0),
            view.metrics.queue.jobs.get((lane, JobState.RUNNING), 0),
            round(view.metrics.queue.oldest_seconds.get(lane, 0.0)),
        )
        for lane in JobQueue
    ]
    lanes.append(
        (_TEST_RUNS_TITLE, view.test_runs.queued, view.test_runs.running, round(view.test_runs.oldest_seconds))
    )
    template = "operator_state.html" if is_htmx_request(request) else "operator.html"
    return render_page(
        request,
        reader,
        template,
        findings=[_translate_finding(finding, detect_language(request)) for finding in view.findings],
        lanes=lanes,
        metrics=view.metrics,
        quarantined=view.quarantined,
        dead=view.failed,
        dead_count=view.failed_count,
        version=view.version,
    )


def _translate_finding(finding: Finding, language: Language) -> Finding:
    return replace(
        finding,
        what=language.translate_sentence(finding.what),
        sentence=language.translate_sentence(finding.sentence),
    )


@router.post("/operator/retry")
def retry(reader: OperatorReader, context: Context, batch_id: SentRowName = "") -> Response:
    """Requeue the failed jobs of one batch or of all batches."""
    batches.retry_dead(context.service, reader.actor, batch_id or None)
    return RedirectResponse("/operator", 303)


@router.get("/operator/courses")
def list_courses(
    request: Request,
    reader: OperatorReader,
    context: Context,
    link: LinkWord = "",
    added: RowNumberAfter = 0,
) -> Response:
    """Show the courses, a form to add an instructor, and the link of the newly added one."""
    actor, created_link = reader.actor, find_created_link(request, context, reader, link)
    lines = course_operations.list_courses(context.service, actor)
    same_id_instructors = people.show(context.service, actor, added).elsewhere if added else ()
    template = "operator_courses.html"
    return render_page(
        request, reader, template, courses=lines, created_link=created_link, added=added, elsewhere=same_id_instructors
    )


@router.post("/operator/courses")
def add_instructor(
    reader: OperatorReader,
    context: Context,
    course: Annotated[str, Form(min_length=1, max_length=100)],
    who: Annotated[str, Form(min_length=1, max_length=100)],
    name: Annotated[str, Form(max_length=200)] = "",
) -> Response:
    """Add an instructor, create the course if it does not exist, and show the operator a sign-in link."""
    word = generate_word()
    member_request = MemberRequest(course, who, name, word=derive_secret(reader, word))
    member = course_operations.add_member(context.service, reader.actor, member_request).member
    return RedirectResponse(f"/operator/courses?link={word}&added={member.enrolment_id}", 303)
