"""Operations on batches and their grades."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from interfaces import Row
from service.operations import batches, exports, moderation, regrades, similarity
from zips import zipped

_RESPONDER = "def responder(msg):\n    return msg\n"
#: Folders of submissions by name.
FOLDERS = {
    "week": {"eve/robot.py": "print('eve')\n", "eve/responder.py": _RESPONDER},
    "notes": {"notes.txt": "nothing"},
}
_NOTHING = (404, "there is no")
_STUDENTS = ("cat", "dan")


def _control(verb: str, state: str, batch: str = "{batch_id}", refused: tuple[int, str] | None = None) -> Row:
    path = f"batches/{batch}/{verb}"
    operation = getattr(batches, verb)
    return Row(operation, (path, {}), ("POST", path, None), f"batch {verb} {batch}", state=state, refused=refused)


def _regrade(state: str, assignment: str = "", refused: tuple[int, str] | None = None) -> Row:
    sent = {"assignment": assignment} if assignment else {}
    return Row(
        regrades.regrade_batch,
        ("batches/{batch_id}/regrade", sent),
        ("POST", "batches/{batch_id}/regrades", sent),
        f"batch regrade {{batch_id}}{f' -a {assignment}' if assignment else ''}",
        state=state,
        refused=refused,
    )


def _regrade_one(
    state: str = "graded", job: str = "{job_id}", assignment: str = "", refused: tuple[int, str] | None = None
) -> Row:
    sent = {"assignment": assignment} if assignment else {}
    return Row(
        regrades.regrade_one,
        (f"grades/{job}/regrade", sent),
        ("POST", f"grades/{job}/regrades", sent),
        f"batch regrade-one {job}{f' -a {assignment}' if assignment else ''}",
        state=state,
        refused=refused,
    )


def _publish(state: str, *, anyway: bool = False, batch: str = "{batch_id}", refused: Any = None) -> Row:
    sent = {"anyway": "true"} if anyway else {}
    return Row(
        regrades.publish,
        (f"batches/{batch}/publish", sent),
        ("POST", f"batches/{batch}/publish", {"anyway": anyway}),
        f"batch publish {batch}{' --anyway' if anyway else ''}",
        state=state,
        refused=refused,
    )


def _publish_one(*, anyway: bool = False, job: str = "{job_id}", refused: Any = None) -> Row:
    sent = {"anyway": "true"} if anyway else {}
    return Row(
        regrades.publish_one,
        (f"grades/{job}/publish", sent),
        ("POST", f"grades/{job}/publish", {"anyway": anyway}),
        f"batch publish-one {job}{' --anyway' if anyway else ''}",
        state="graded",
        refused=refused,
    )


def _grade_over_limit(state: str, job: str = "{job_id}", refused: tuple[int, str] | None = None) -> Row:
    return Row(
        regrades.grade_over_limit,
        (f"grades/{job}/grade-over-limit", {}),
        ("POST", f"grades/{job}/over-limit", None),
        f"batch grade-over-limit {job}",
        state=state,
        refused=refused,
    )


def _submit(folder: str, assignment: str = "echo-responder", refused: tuple[int, str] | None = None) -> Row:
    sent = zipped(FOLDERS[folder])
    return Row(
        batches.submit,
        ("batches/uploads", {"assignment": assignment}),
        ("POST", f"batches?name={folder}&assignment={assignment}", sent),
        f"batch submit {{folder}}/{folder} -a {assignment}",
        refused=refused,
        files={f"files:{folder}.zip": sent},
        then="/confirm",
    )


def _read(
    operation: Any,
    path: str,
    query: Mapping[str, Any],
    command: str,
    says: tuple[str, ...],
    refused: tuple[int, str] | None = None,
) -> Row:
    query_text = "&".join(f"{name}={value}" for name, value in query.items())
    api = ("GET", f"{path}?{query_text}", None)
    return Row(operation, (path, query), api, command, state="graded", says=says, refused=refused)


#: Accepted, although there is nothing to change.
UNCHANGED = {"pause again", "cancel nothing"}
ROWS = {
    "pause": _control("pause", "queued"),
    "pause again": _control("pause", "paused"),
    "pause no such batch": _control("pause", "course", "nothing", _NOTHING),
    "resume": _control("resume", "paused"),
    "resume cancelled": _control("resume", "cancelled", refused=(422, "cancelled")),
    "cancel": _control("cancel", "queued"),
    "cancel nothing": _control("cancel", "graded"),
    "retry": _control("retry", "dead"),
    "retry no such batch": _control("retry", "course", "nothing", _NOTHING),
    "retry all": Row(batches.retry_dead, ("/operator/retry", {}), ("POST", "/operator/retry", None),
        "batch retry --all", who="root", state="dead"),
    "regrade": _regrade("graded"),
    "regrade nothing": _regrade("queued", refused=(422, "nothing")),
    "regrade by another assignment": _regrade("graded", "first-program", (422, "first-program")),
    "regrade by an unknown assignment": _regrade("graded", "typo", (422, "typo")),
    "regrade one": _regrade_one(),
    "regrade one by its own assignment": _regrade_one(assignment="echo-responder"),
    "regrade one by another assignment": _regrade_one(
        assignment="shape-recognition", refused=(422, "this submission is for")
    ),
    "regrade one that waits": _regrade_one("queued", refused=(422, "")),
    "regrade no such grade": _regrade_one(job="nothing", refused=_NOTHING),
    "publish": _publish("graded"),
    "publish regrades": _publish("regraded"),
    "publish anyway": _publish("graded", anyway=True),
    "publish no such batch": _publish("graded", batch="nothing", refused=_NOTHING),
    "publish one": _publish_one(),
    "publish one anyway": _publish_one(anyway=True),
    "publish no such grade": _publish_one(job="nothing", refused=_NOTHING),
    "grade what is over a limit": _grade_over_limit("over a limit"),
    "grade what is over no limit": _grade_over_limit("graded", refused=(409, "is not waiting for staff")),
    "grade no such submission": _grade_over_limit("graded", "nothing", _NOTHING),
    "submit a batch": _submit("week"),
    "submit an unreadable batch": _submit("notes", refused=(422, "")),
    "submit for an unknown assignment": _submit("week", "typo", (422, "typo")),
    "export": _read(exports.download, "batches/{batch_id}/export", {"format": "csv"},
        "batch export {batch_id} --format csv", _STUDENTS),
    "export in an unknown format": _read(exports.download, "batches/{batch_id}/export", {"format": "typo"},
        "batch export {batch_id} --format typo", _STUDENTS, (422, "")),
    "export no such batch": _read(exports.download, "batches/nothing/export", {"format": "csv"},
        "batch export nothing --format csv", _STUDENTS, _NOTHING),
    "moderation sheet": _read(moderation.download_sheet, "batches/{batch_id}/moderation",
        {"assignment": "echo-responder"}, "batch moderation {batch_id} -a echo-responder", _STUDENTS),
    "moderation sheet of another assignment": _read(moderation.download_sheet, "batches/{batch_id}/moderation",
        {"assignment": "typo"}, "batch moderation {batch_id} -a typo", _STUDENTS, (404, "typo")),
    "moderation sheet of no such batch": _read(moderation.download_sheet, "batches/nothing/moderation",
        {"assignment": "echo-responder"}, "batch moderation nothing", _STUDENTS, _NOTHING),
    "similar": _read(similarity.show_similar, "batches/{batch_id}/similar", {}, "batch similar {batch_id}", _STUDENTS),
    "similar in no such batch": _read(similarity.show_similar, "batches/nothing/similar", {},
        "batch similar nothing", _STUDENTS, _NOTHING),
    "preview a publication": _read(regrades.preview_publication, "batches/{batch_id}/publish", {},
        "batch publish-preview {batch_id}", ("2",)),
    "preview the publication of no such batch": _read(regrades.preview_publication, "batches/nothing/publish", {},
        "batch publish-preview nothing", ("2",), _NOTHING),
}  # fmt: skip
