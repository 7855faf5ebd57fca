"""Operations on a grade, on appeals, and on students' own submissions."""

from __future__ import annotations

import report_builders
from interfaces import Row
from service.operations import appeals, grades, playground, submissions, test_runs

_CRITERION = report_builders.faulty_grade().criteria[0].id
_STUDENTS = "students have no commands on the machine"
_BOTH = {
    "files:robot.py": "print('hello')\n",
    "files:responder.py": "def responder(msg):\n    return msg\n",
}
_LOOP = "floor=Loop&x=500&y=400&heading=90&light_noise=10&motor_noise=0"
_CHANGED = (409, "another person changed the marks")


def _set(marks: str, reason: str, seen: int, refused: tuple[int, str] | None = None, state: str = "course") -> Row:
    return Row(
        grades.set_marks,
        ("grades/{job_id}/marking/set", {"criterion": _CRITERION, "marks": marks, "reason": reason, "seen": seen}),
        ("PUT", f"grades/{{job_id}}/marking/{_CRITERION}", {"marks": marks, "reason": reason, "seen": seen}),
        f"mark set {{job_id}} {_CRITERION} {marks} --reason '{reason}' --seen {seen}",
        refused=refused,
        state=state,
    )


def _excuse(criterion: str, seen: int, refused: tuple[int, str] | None = None, state: str = "course") -> Row:
    return Row(
        grades.set_marks,
        ("grades/{job_id}/marking/excuse", {"criterion": criterion, "reason": "was ill", "seen": seen}),
        ("PUT", f"grades/{{job_id}}/marking/{criterion}", {"marks": None, "reason": "was ill", "seen": seen}),
        f"mark excuse {{job_id}} {criterion} --reason 'was ill' --seen {seen}",
        refused=refused,
        state=state,
    )


def _withdraw(seen: int, refused: tuple[int, str] | None = None, state: str = "marked") -> Row:
    return Row(
        grades.withdraw_override,
        ("grades/{job_id}/marking/withdraw", {"criterion": _CRITERION, "seen": seen}),
        ("DELETE", f"grades/{{job_id}}/marking/{_CRITERION}?seen={seen}", None),
        f"mark withdraw {{job_id}} {_CRITERION} --seen {seen}",
        refused=refused,
        state=state,
    )


def _comment(text: str, criterion: str = "", refused: tuple[int, str] | None = None, job: str = "{job_id}") -> Row:
    return Row(
        grades.add_comment,
        (f"grades/{job}/marking/comment", {"text": text, "criterion": criterion}),
        ("POST", f"grades/{job}/comments", {"text": text, "criterion": criterion}),
        f"mark comment {job} '{text}' --criterion '{criterion}'",
        refused=refused,
    )


def _uncomment(number: int, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        grades.withdraw_comment,
        ("grades/{job_id}/marking/uncomment", {"comment_id": number}),
        ("DELETE", f"grades/{{job_id}}/comments/{number}", None),
        f"mark uncomment {{job_id}} {number}",
        state="marked",
        refused=refused,
    )


def _answer(
    number: int, refused: tuple[int, str] | None = None, state: str = "course", text: str = "It is right."
) -> Row:
    return Row(
        appeals.answer,
        (f"appeals/{number}/answer", {"text": text}),
        ("POST", f"appeals/{number}/answer", {"text": text}),
        f"appeals answer {number} '{text}'",
        state=state,
        refused=refused,
    )


def _ask(state: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        appeals.submit,
        ("mine/submissions/1/appeal", {"text": "And now?"}),
        ("POST", "mine/submissions/1/appeals", {"text": "And now?"}),
        alone=_STUDENTS,
        who="ada",
        state=state,
        refused=refused,
    )


def _run_all_trials(state: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        appeals.run_all_trials,
        ("mine/submissions/1/all-trials", {}),
        ("POST", "mine/submissions/1/all-trials", None),
        alone=_STUDENTS,
        who="ada",
        state=state,
        refused=refused,
    )


def _send(
    operation: object, files: dict[str, str], refused: tuple[int, str] | None = None, state: str = "course"
) -> Row:
    is_submit = operation is submissions.submit
    path = f"mine/{'submissions' if is_submit else 'tryouts'}?assignment=echo-responder"
    return Row(
        submissions.submit if is_submit else test_runs.start,
        (f"mine/echo-responder{'' if is_submit else '/try'}", {}),
        ("POST", path, "files"),
        alone=_STUDENTS,
        who="ada",
        state=state,
        files=files,
        refused=refused,
    )


def _play(
    files: dict[str, str], world: str, refused: tuple[int, str] | None = None, who: str = "ada", state: str = "course"
) -> Row:
    return Row(
        playground.start,
        ("playground", dict(each.split("=") for each in world.split("&"))),
        ("POST", f"playground?{world}", "files"),
        alone=_STUDENTS,
        who=who,
        state=state,
        files=files,
        refused=refused,
    )


ROWS = {
    "set marks": _set("1", "seen again", 0),
    "set marks again": _set("2", "seen again", 1, state="marked"),
    "set marks that have changed": _set("2", "seen again", 0, _CHANGED, "marked"),
    "set too many marks": _set("1000", "seen again", 0, (422, "expected 0 to")),
    "set marks without a reason": _set("2", "  ", 0, (422, "the reason has 0 characters")),
    "set marks before there is a grade": _set("2", "seen again", 0, (409, "has no grade"), "queued"),
    "excuse": _excuse(_CRITERION, 0),
    "excuse what there is not": _excuse("other", 0, (422, "has no criterion")),
    "excuse what has changed": _excuse(_CRITERION, 0, _CHANGED, "marked"),
    "withdraw": _withdraw(1),
    "withdraw what has changed": _withdraw(7, _CHANGED),
    "withdraw nothing": _withdraw(0, (422, "are not adjusted"), "course"),
    "withdraw before there is a grade": _withdraw(1, (409, "has no grade"), "queued"),
    "comment": _comment("Well done."),
    "comment on a criterion": _comment("Look there.", _CRITERION),
    "comment on what there is not": _comment("Look there.", "other", (422, "has no criterion")),
    "comment without text": _comment("  ", refused=(422, "the comment has 0 characters")),
    "comment on no such grade": _comment("Well done.", refused=(404, "there is no"), job="nothing"),
    "withdraw a comment": _uncomment(1),
    "withdraw no comment": _uncomment(7, (422, "has no comment 7")),
    "answer an appeal": _answer(1),
    "answer an appeal again": _answer(1, (422, "already has an answer"), "answered"),
    "answer no appeal": _answer(7, (422, "this course has no appeal 7")),
    "answer without text": _answer(1, (422, "0 characters"), text="  "),
    "appeal": _ask("answered"),
    "run all trials": _run_all_trials("provisional"),
    "run all trials of an exact grade": _run_all_trials("course", (422, "these marks are exact already")),
    "appeal twice": _ask("course", (422, "you already have an open appeal")),
    "submit": _send(submissions.submit, _BOTH),
    "submit nothing": _send(submissions.submit, {}, (422, "no files were submitted")),
    "submit an empty program": _send(submissions.submit, _BOTH | {"files:robot.py": " "}, (422, "is empty")),
    "submit to what is closed": _send(submissions.submit, _BOTH, (422, "closed"), "closed"),
    "start a test run": _send(test_runs.start, _BOTH),
    "run in the playground": _play(_BOTH, _LOOP),
    "run in the playground as staff": _play({"files:robot.py": "print('hello')\n"}, _LOOP, who="grace"),
    "run in the playground beside a test": _play(_BOTH, _LOOP, (422, "is not completed yet"), state="running a test"),
    "run on no such floor": _play(_BOTH, _LOOP.replace("Loop", "Lop"), (422, "there is no floor called")),
    "run beside the floor": _play(_BOTH, _LOOP.replace("x=500", "x=5000"), (422, "")),
    "run nothing": _play({}, _LOOP, (422, "no files were submitted")),
    "start two test runs": _send(test_runs.start, _BOTH, (422, "is not completed yet"), "running a test"),
}  # fmt: skip
