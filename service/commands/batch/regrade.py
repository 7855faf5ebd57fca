"""``robomark batch regrade`` and ``publish``: grade a batch again, see what changes and why, let it stand.

What they do stands in ``store/regrades.py`` and ``store/publishing.py``.
"""

from __future__ import annotations

from typing import Annotated

import typer

from service.commands.batch.control import BatchId
from service.commands.batch.tables import changes_table
from service.commands.shown import document, note, show, tell
from service.settings import load_settings
from service.store import audit
from service.store.batches import batches, publishing, regrades
from service.store.batches.publishing import Published
from service.store.batches.regrades import Regraded
from service.store.engine import Store, open_store
from service.store.states import JobState, Lane
from sim.errors import HostError


def regrade(
    batch: BatchId,
    assignment: Annotated[
        str | None, typer.Option("-a", "--assignment", help="The changed assignment: its id or its folder.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Wait for the new grades and show what they change.")] = False,
) -> None:
    """Grade a batch again after its assignment or the grader changed; the old grades stand until you publish."""
    # The queue takes long to load, which whoever publishes need not wait for.
    from service.commands.batch.awaited import awaited
    from service.queue.celery_app import make_celery
    from service.queue.logs import configure_logging
    from service.queue.notifier import Notifier
    from submissions.assignment.reader import find_assignment

    settings = load_settings()
    configure_logging(settings.log_level)
    changed = None if assignment is None else find_assignment(assignment)
    with open_store(settings) as store:
        batch_id = _find(store, batch)
        made = regrades.regrade(store, batch_id, changed, max_attempts=settings.max_attempts, actor=audit.this_user())
        tell(f"batch {made.batch_id}: {made.jobs} queued to be graded again{_left_out(made)}")
        if not wait:
            if settings.broker_url:
                Notifier(make_celery(settings), store, settings).grade(Lane.BATCH, made.jobs)
            note(f"what changes, and why: robomark batch status {made.batch_id}")
            document(batch=made.batch_id, regraded=made)
            return
        with awaited(store, settings, [made.batch_id], made.jobs) as regraded:
            regraded.for_marks()
            with store.reading() as session:
                changes = regrades.changes(session, made.batch_id)
            show(changes_table(changes))
            note(f"to let the new grades stand: robomark batch publish {made.batch_id}")
            regraded.for_plots()
    document(batch=made.batch_id, regraded=made, changes=changes)
    dead = [change for change in changes if change.state is JobState.DEAD]
    if dead:
        raise HostError(f"{len(dead)} of {len(changes)} could not be graded; {dead[0].student}: {dead[0].reason}")


def publish(
    batch: BatchId,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Also where a criterion could not be judged: it gives no marks.")
    ] = False,
) -> None:
    """Let the newest grades of a batch stand, and release them to the students."""
    with open_store(load_settings()) as store:
        batch_id = _find(store, batch)
        done = publishing.publish(store, batch_id, actor=audit.this_user(), anyway=anyway)
    document(batch=batch_id, published=done)
    _tell_published(f"batch {batch_id}", done)


def publish_one(
    grade: Annotated[str, typer.Argument(help="The grade's id, or the beginning of it.")],
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Also where a criterion could not be judged: it gives no marks.")
    ] = False,
) -> None:
    """Let the newest grade of one submission stand, and release it to its student."""
    with open_store(load_settings()) as store:
        with store.reading() as session:
            job_id = batches.find_job(session, grade)
        done = publishing.publish_one(store, job_id, actor=audit.this_user(), anyway=anyway)
    document(grade=job_id, published=done)
    _tell_published(f"grade {job_id}", done)


def _tell_published(of_what: str, done: Published) -> None:
    left = [
        f"{count} {what}"
        for count, what in (
            (done.unfinished, "not graded yet"),
            (done.dead, "could not be graded"),
            (done.staff_only, "over a limit and for staff only"),
            (done.unjudged, "with criteria that could not be judged (--anyway publishes them)"),
        )
        if count
    ]
    replaced = f", {done.replaced} of them regrades" if done.replaced else ""
    tell(f"{of_what}: {done.published} grades published{replaced}{'; left: ' if left else ''}{', '.join(left)}")


def _left_out(made: Regraded) -> str:
    left = []
    if made.other_assignment:
        left.append(f"{made.other_assignment} left, for another assignment")
    if made.unfinished:
        left.append(f"{made.unfinished} left, not graded yet")
    return "".join(f"; {sentence}" for sentence in left)


def _find(store: Store, start: str) -> str:
    with store.reading() as session:
        return batches.find_batch(session, start)
