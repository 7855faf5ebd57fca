"""Operations on courses, their assignments, people, webhooks and learning platforms."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from interfaces import Row
from service.operations import (
    assignment_uploads,
    assignments,
    courses,
    people,
    platforms,
    policies,
    privacy,
    sign_in_links,
    webhooks,
)
from submissions.assignment.export import create_assignment
from submissions.roster import parse_time
from zips import zipped

DUE = "2030-01-02T10:00"
_ADDRESSES = {f"{each}_url": f"https://moodle.example.org/{each}" for each in ("authorization", "token", "keys")}
_PLATFORM = {"name": "Moodle", "issuer": "https://moodle.example.org", "client_id": "x"} | _ADDRESSES
TABLE = b"id,name,email\nzoe,Zoe,zoe@example.org\nada,Ada Lovelace,\n"
_TWO = [{"id": "zoe", "name": "Zoe", "email": "zoe@example.org"}, {"id": "ada", "name": "Ada Lovelace"}]
_HOOK = "https://hooks.example.org/other"
_NO_PAGE = "a program that receives events also sets them up"


def _extension(refused: tuple[int, str] | None = None, who: str = "ada", **changes: Any) -> Row:
    assignment, due, more = changes.get("assignment", ""), changes.get("due", ""), changes.get("more", 0)
    api = {"assignment": assignment, "due_at": parse_time(due).isoformat() if due else None, "more_attempts": more}
    words = (f"-a {assignment} " if assignment else "") + (f"--due {due} " if due else "")
    return Row(
        policies.extend,
        (f"people/{{{who}}}/extensions", {"assignment": assignment, "due": due, "more_attempts": more}),
        ("POST", f"people/{{{who}}}/extensions", api),
        f"course extend {who} {words}--more-attempts {more}",
        refused=refused,
    )


def _policy(refused: tuple[int, str] | None = None, assignment: str = "", due: str = DUE) -> Row:
    numbers, named = {"late_days": 2, "attempts": 3}, f"-a {assignment}" if assignment else ""
    sent = {"assignment": assignment, "due_at": parse_time(due).isoformat(), "cool_down_seconds": 600, **numbers}
    return Row(
        policies.set_policy,
        ("policy", {"assignment": assignment, "due": due, "cool_down": 10, **numbers}),
        ("PUT", "policies", sent),
        f"course policy {named} --due {due} --late-days 2 --attempts 3 --cool-down 10",
        refused=refused,
    )


def _assignment(verb: str, operation: Any, assignment: str, refused: tuple[int, str] | None = None) -> Row:
    drops, path = verb == "remove", f"assignments/{assignment}"
    return Row(
        operation,
        (f"{path}/{verb}", {}),
        ("DELETE", path, None) if drops else ("POST", f"{path}/{verb}", None),
        f"course {verb} {assignment}",
        refused=refused,
    )


def _names(verb: str, hidden: bool, assignment: str = "echo-responder", refused: tuple[int, str] | None = None) -> Row:
    return Row(
        assignments.hide_names,
        (f"assignments/{assignment}/names", {"hidden": str(hidden).lower()}),
        ("POST", f"assignments/{assignment}/names", {"names_hidden": hidden}),
        f"course {verb}-names {assignment}",
        refused=refused,
    )


def _prepare(assignment: str, refused: tuple[int, str] | None = None) -> Row:
    sent = {"assignment": assignment}
    return Row(
        assignment_uploads.prepare_from_catalogue,
        ("assignments", sent),
        ("POST", "assignments", sent),
        f"course prepare {assignment}",
        refused=refused,
    )


def _link(who: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        sign_in_links.make_students_link,
        (f"people/{{{who}}}/link", {}),
        ("POST", f"people/{{{who}}}/link", None),
        alone="operators have robomark user link, which signs in to all courses of the person",
        refused=refused,
    )


def _links(days: int, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        sign_in_links.make_links,
        ("people/links", {"days": days}),
        ("POST", "people/links", {"days": days}),
        f"user links --days {days}",
        refused=refused,
    )


def _member(course: str, who: str, name: str = "", refused: tuple[int, str] | None = None) -> Row:
    return Row(
        courses.add_member,
        ("/operator/courses", {"course": course, "who": who, "name": name}),
        ("POST", "/operator/courses", {"course": course, "id": who, "name": name}),
        f"user add '{who}' --name '{name}' --course '{course}'",
        who="root",
        refused=refused,
    )


def _erase(who: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        privacy.erase_student,
        None,
        ("DELETE", f"people/{{{who}}}", None),
        f"course delete-student {who} --for-good",
        alone="a page removes a student who has submitted nothing; all else needs a decision beside it",
        refused=refused,
    )


def _webhook(url: str, refused: tuple[int, str] | None = None, state: str = "course") -> Row:
    return Row(
        webhooks.create,
        None,
        ("POST", "webhooks", {"url": url, "events": ["batch.finished"]}),
        f"webhook add '{url}' --event batch.finished",
        alone=_NO_PAGE,
        state=state,
        refused=refused,
    )


def _no_webhook(webhook: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        webhooks.revoke,
        None,
        ("DELETE", f"webhooks/{webhook}", None),
        f"webhook remove {webhook}",
        alone=_NO_PAGE,
        refused=refused,
    )


def _platform(deployment: str, refused: tuple[int, str] | None = None, **changes: str) -> Row:
    registration = _PLATFORM | changes
    options = {"issuer": "issuer", "client": "client_id", "login-url": "authorization_url"}
    options |= {"token-url": "token_url", "keys-url": "keys_url"}
    options_text = " ".join(f"--{option} {registration[key]}" for option, key in options.items())
    return Row(
        platforms.register,
        ("/operator/platforms", registration | {"deployments": deployment}),
        ("POST", "/operator/platforms", registration | {"deployments": deployment.replace(",", " ").split()}),
        f"platform add '{registration['name']}' {options_text} "
        + " ".join(f"--deployment {each}" for each in deployment.replace(",", " ").split()),
        who="root",
        refused=refused,
    )


def _of_platform(operation: Any, action: str, sent: dict[str, str], command: str) -> Row:
    refused = (422, "not linked to a learning platform")
    path = f"platform/{action}"
    return Row(operation, (path, sent), ("POST", path, sent or None), f"platform {command}", refused=refused)


def _upload(files: dict[str, str | bytes], refused: tuple[int, str] | None = None) -> Row:
    (content,) = files.values()
    return Row(
        assignment_uploads.upload,
        ("assignments/uploads", {}),
        ("POST", "assignments/uploads", content),
        alone="commands prepare folders",
        files=files,
        refused=refused,
    )


def _own_assignment() -> bytes:
    """Return a zip of an assignment that an instructor wrote."""
    with TemporaryDirectory() as made:
        folder = Path(made) / "mine"
        create_assignment(folder)
        return zipped({f"mine/{each.name}": each.read_bytes() for each in folder.iterdir() if each.is_file()})


def _counted_attempt(rule: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        policies.set_counted_attempt,
        ("policy/counted-attempt", {"counted_attempt": rule}),
        ("PUT", "policies/counted-attempt", {"counted_attempt": rule}),
        f"course policy --counted-attempt {rule}",
        refused=refused,
    )


def _completion_rule(rule: str, refused: tuple[int, str] | None = None) -> Row:
    return Row(
        policies.set_completion_rule,
        ("policy/completion-rule", {"completion_rule": rule}),
        ("PUT", "policies/completion-rule", {"completion_rule": rule}),
        f"course policy --completion-rule {rule}",
        refused=refused,
    )


ROWS = {
    "set the policy of a course": _policy(),
    "set the policy of an assignment": _policy(assignment="echo-responder"),
    "set the policy of no assignment": _policy((422, "echo-typo"), assignment="echo-typo"),
    "set a deadline in another century": _policy((422, ""), due="2999-01-02T10:00"),
    "count the best attempt": _counted_attempt("best"),
    "count the worst attempt": _counted_attempt("worst", (422, "")),
    "replace published marks with lower exact ones": _completion_rule("exact"),
    "replace published marks with lower ones only": _completion_rule("lower", (422, "")),
    "drop a policy": Row(
        policies.drop_policy,
        ("assignments/echo-responder/no-policy", {}),
        ("DELETE", "policies?assignment=echo-responder", None),
        "course policy -a echo-responder --drop",
        state="with a policy",
    ),
    "extend": _extension(assignment="echo-responder", due=DUE, more=2),
    "extend for all assignments": _extension(more=1),
    "extend by nothing": _extension((422, "later deadline")),
    "extend for no assignment": _extension((422, "echo-typo"), assignment="echo-typo", more=1),
    "extend till another century": _extension((422, ""), due="2999-01-02T10:00"),
    "extend for an instructor": _extension((404, "not a student"), who="grace", more=1),
    "enrol": Row(
        people.enrol,
        ("people/table", {}),
        ("POST", "people", {"students": _TWO}),
        "course enrol {folder}/people.csv",
        files={"file:people.csv": TABLE},
    ),
    "make a student's link": _link("ada"),
    "make an instructor's link as a student's": _link("grace", (404, "not a student")),
    "make links for a course": _links(3),
    "make links for too long": _links(31, (422, "30")),
    "add an instructor of a new course": _member(" TM129 ", "linus", "Linus"),
    "add a blank instructor": _member("TM129", " ", refused=(422, "")),
    "add a student as an instructor": _member("default", "ada", refused=(422, "ada")),
    "sign a person out": Row(
        people.sign_out,
        ("/operator/people/{ada}/sign-out", {}),
        ("POST", "/operator/people/{ada}/sign-out", None),
        "user sign-out ada",
        who="root",
    ),
    "join two of one course": Row(
        people.join,
        ("/operator/people/{ada}/join", {"other_id": "{grace}"}),
        ("POST", "/operator/people/{ada}/join", {"other": "{grace}"}),
        "user join ada --same-as grace --of default",
        who="root",
        refused=(409, "both accounts are in the course default"),
    ),
    "remove a student": Row(
        people.remove,
        ("people/{leaver}/remove", {}),
        None,
        "user remove leaver",
        alone="a program erases a student, also one who has submitted nothing",
    ),
    "remove a student who has submitted": Row(
        people.remove,
        ("people/{ada}/remove", {}),
        None,
        "user remove ada",
        alone="a program erases a student, also one who has submitted nothing",
        refused=(422, ""),
    ),
    "erase a student": _erase("ada"),
    "erase an instructor": _erase("grace", (404, "not a student")),
    "prepare": _prepare("shape-recognition"),
    "prepare again": _prepare("echo-responder"),
    "prepare what there is not": _prepare("typo", (422, "typo")),
    "open": _assignment("open", assignments.open_for_students, "json-queue"),
    "open none": _assignment("open", assignments.open_for_students, "echo-typo", (422, "echo-typo")),
    "close": _assignment("close", assignments.close, "echo-responder"),
    "close none": _assignment("close", assignments.close, "echo-typo", (422, "echo-typo")),
    "remove an assignment": _assignment("remove", assignments.remove, "json-queue"),
    "remove what students have been shown": _assignment(
        "remove", assignments.remove, "echo-responder", (422, "have already seen it")
    ),
    "hide names": _names("hide", True),
    "show names": _names("show", False),
    "hide names of no assignment": _names("hide", True, "echo-typo", (422, "echo-typo")),
    "upload": _upload({"file:mine.zip": _own_assignment()}),
    "upload no assignment": _upload({"file:mine.zip": zipped({"notes.txt": "nothing"})}, (422, "")),
    "preview": Row(
        assignment_uploads.preview,
        ("assignments/json-queue/preview", {}),
        ("POST", "assignments/json-queue/preview", None),
        alone="a preview is a submission of an instructor's own, and commands have no person",
    ),
    "add a webhook": _webhook(_HOOK),
    "add a webhook at no address": _webhook("ftp://x", (422, "expected http")),
    "add too many webhooks": _webhook(_HOOK, (422, "revoke one first"), "many webhooks"),
    "remove a webhook": _no_webhook("{webhook_id}"),
    "remove no webhook": _no_webhook("nothing", (404, "there is no")),
    "register a platform": _platform("2, 1"),
    "register a platform without a deployment": Row(
        platforms.register,
        ("/operator/platforms", _PLATFORM | {"deployments": " , "}),
        ("POST", "/operator/platforms", _PLATFORM | {"deployments": []}),
        alone="the command line demands its option",
        who="root",
        refused=(422, "deployment"),
    ),
    "register a platform at a file": _platform("1", (422, "address is"), keys_url="file:///etc/passwd"),
    "register a platform without a name": _platform("1", (422, ""), name=" "),
    "enrol the members of no platform": _of_platform(platforms.enrol_members, "members", {}, "enrol"),
    "send marks to no platform": _of_platform(
        platforms.pass_back, "marks", {"assignment": "echo-responder"}, "send-marks echo-responder"
    ),
}  # fmt: skip
