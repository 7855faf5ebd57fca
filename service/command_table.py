"""Table of all commands with their modules and summaries. Imports none of them.

Each command has its own help text; ``command_line.py`` loads the selected one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Command:
    """A command at ``module:name`` below ``service.commands``.

    ``serves`` marks those that run until stopped and log.
    """

    where: str
    summary: str
    serves: bool = False


@dataclass(frozen=True, slots=True)
class CommandGroup:
    """A named group of commands."""

    summary: str
    commands: Mapping[str, Command]


#: In the order of the help text.
COMMANDS: Mapping[str, Command | CommandGroup] = MappingProxyType(
    {
        "run": Command("run:run", "Run a robot program or a notebook in the simulator."),
        "grade": Command("grade:grade", "Grade submissions now."),
        "batch": CommandGroup(
            "Grade many submissions through the queue.",
            {
                "submit": Command("batch.submit:submit", "Queue a submission for each student."),
                "list": Command("batch.listing:list_batches", "List the newest batches."),
                "status": Command("batch.status:status", "Show how far a batch is, its marks and statistics."),
                "overview": Command("batch.overview:show_overview", "Show what came of a batch at a glance."),
                "similar": Command("batch.similar:similar", "Show whose submissions are alike, for staff."),
                "export": Command("batch.export:export", "Write the marks of a batch for another program."),
                "pause": Command("batch.control:pause", "Begin no more of a batch."),
                "resume": Command("batch.control:resume", "Let a paused batch go on."),
                "cancel": Command("batch.control:cancel", "End what of a batch is not graded yet."),
                "retry": Command("batch.control:retry", "Queue again what could not be graded."),
                "regrade": Command("batch.regrade:regrade", "Grade a batch again."),
                "publish": Command("batch.regrade:publish", "Let the newest grades stand, and release them."),
                "publish-one": Command("batch.regrade:publish_one", "The same for one submission."),
                "publish-preview": Command("batch.regrade:preview_publication", "Show what publishing would do."),
                "regrade-one": Command("batch.regrade:regrade_one", "Grade one submission again."),
                "grade-over-limit": Command("batch.regrade:grade_over_limit", "Grade one that is over a limit."),
            },
        ),
        "assignments": CommandGroup(
            "List, show, check, make and export assignments.",
            {
                "list": Command("assignments.listing:list_assignments", "List the catalogue."),
                "show": Command("assignments.showing:show", "Show what an assignment asks for."),
                "check": Command("assignments.checking:check", "Find mistakes in an assignment, grade its examples."),
                "new": Command("assignments.writing:new", "Make the folder of a new assignment."),
                "export": Command("assignments.writing:export", "Write an assignment out."),
                "autograder": Command("assignments.writing:autograder", "Make an autograder for Gradescope."),
            },
        ),
        "models": CommandGroup(
            "List, train and evaluate classifiers.",
            {
                "list": Command("models.cards:list_models", "List the classifiers and how often each is right."),
                "train": Command("models.measuring:train", "Train a classifier again."),
                "evaluate": Command("models.measuring:evaluate", "Measure a classifier."),
                "compare": Command("models.cards:compare", "Show the cards of classifiers side by side."),
            },
        ),
        "floors": Command("floors:floors", "Draw every floor with its scale."),
        "show": Command("show:show", "Show a grade that is stored."),
        "mark": CommandGroup(
            "Set marks by hand, and write to students.",
            {
                "set": Command("marking:set_marks", "Set the marks of a criterion."),
                "excuse": Command("marking:excuse", "Let a criterion not count."),
                "withdraw": Command("marking:withdraw", "Let the grader's marks count again."),
                "comment": Command("marking:comment", "Write a comment for the student."),
                "uncomment": Command("marking:uncomment", "Withdraw a comment."),
                "history": Command("marking:history", "Show what was set and written, and by whom."),
            },
        ),
        "appeals": CommandGroup(
            "Answer students who ask for a second look.",
            {
                "list": Command("appeals:list_appeals", "List the open appeals."),
                "answer": Command("appeals:answer", "Answer an appeal, which closes it."),
            },
        ),
        "verify": Command("verify:verify", "Run a stored grading again and compare."),
        "course": CommandGroup(
            "Say when and how often students may submit.",
            {
                "list": Command("course:list_courses", "List the courses."),
                "policy": Command("course:policy", "Say what holds for all, or show it."),
                "extend": Command("course:extend", "Allow one student more time or attempts."),
                "enrol": Command("course:enrol", "Enrol students before they submit."),
                "prepare": Command("course:prepare", "Put an assignment into a course."),
                "open": Command("course:open_assignment", "Let students submit to it on the web."),
                "close": Command("course:close_assignment", "Let nobody submit to it any more."),
                "remove": Command("course:remove_assignment", "Take out one that no student has been shown."),
                "hide-names": Command("course:hide_names", "Hide the students' names of an assignment."),
                "show-names": Command("course:show_names", "Show the students' names of an assignment."),
                "export-student": Command("privacy:export_student", "Write all there is of a student."),
                "delete-student": Command("privacy:delete_student", "Remove all there is of a student."),
                "purge": Command("privacy:purge_course", "Remove what is old."),
            },
        ),
        "user": CommandGroup(
            "Say who instructs, and let people sign in on the web.",
            {
                "add": Command("user:add", "Add an instructor, an operator or a student."),
                "link": Command("user:link", "Print a link that signs somebody in once."),
                "links": Command("user:links", "Print a sign-in link for each student of a course."),
                "token": Command("user:token", "Print a token for programs."),
                "list": Command("user:list_people", "List who is in a course."),
                "sign-out": Command("user:sign_out", "End somebody's links, sessions and tokens."),
                "remove": Command("user:remove", "Remove somebody from a course."),
                "join": Command("user:join", "Make one person of two in different courses."),
            },
        ),
        "webhook": CommandGroup(
            "Send events of a course to other programs.",
            {
                "add": Command("webhooks:add", "Add a webhook."),
                "list": Command("webhooks:list_webhooks", "List the webhooks of a course."),
                "remove": Command("webhooks:remove", "Remove a webhook."),
                "deliveries": Command("webhooks:list_deliveries", "List the newest deliveries."),
            },
        ),
        "platform": CommandGroup(
            "Connect Robomark to learning platforms.",
            {
                "add": Command("platforms:add", "Register a learning platform."),
                "list": Command("platforms:list_platforms", "List the registered platforms."),
                "enrol": Command("platforms:enrol_members", "Enrol a platform's members in a course."),
                "send-marks": Command("platforms:send_marks", "Send published marks to a platform."),
            },
        ),
        "up": Command("up:up", "Bring up broker, workers and web server.", serves=True),
        "serve": Command("up:serve", "Answer on the web: pages, API, health and metrics.", serves=True),
        "worker": Command("worker:worker", "Grade what is queued until told to stop.", serves=True),
        "doctor": Command("doctor:doctor", "Look at everything that grading needs on this machine."),
        "db": CommandGroup(
            "Look after the database.",
            {
                "upgrade": Command("database:upgrade_tables", "Bring the tables up to this release."),
                "backup": Command("database:backup_database", "Copy the database while it is in use."),
                "restore": Command("database:restore_database", "Bring a backup into an empty database."),
                "purge": Command("database:purge_database", "Remove what is old."),
            },
        ),
        "sandbox": CommandGroup(
            "Show the sandbox round student code.",
            {"check": Command("sandbox:check", "Put up the sandbox, try it, and say which layers stand.")},
        ),
        "demo": Command("demo:demo", "Grade sample submissions through a real worker."),
    }
)
