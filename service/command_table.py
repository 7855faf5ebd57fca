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

    ``serves`` marks those that run until stopped and log, ``hidden`` those that programs start.
    """

    entry_point: str
    summary: str
    serves: bool = False
    hidden: bool = False


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
                "status": Command("batch.status:status", "Show the progress, marks and statistics of a batch."),
                "overview": Command("batch.overview:show_overview", "Show an overview of a batch."),
                "similar": Command("batch.similar:similar", "Show similar submissions, for staff."),
                "luck": Command("batch.luck:luck", "Show how much of the marks is luck, for staff."),
                "export": Command("batch.export:export", "Export the marks of a batch for another program."),
                "moderation": Command("batch.moderation:moderation", "Write a sheet for external examiners."),
                "pause": Command("batch.control:pause", "Pause a batch: start no more jobs."),
                "resume": Command("batch.control:resume", "Resume a paused batch."),
                "cancel": Command("batch.control:cancel", "Cancel the unfinished jobs of a batch."),
                "retry": Command("batch.control:retry", "Queue failed jobs again."),
                "regrade": Command("batch.regrade:regrade", "Grade a batch again."),
                "publish": Command("batch.regrade:publish", "Publish the newest grades of a batch."),
                "publish-one": Command("batch.regrade:publish_one", "Publish one grade."),
                "publish-preview": Command("batch.regrade:preview_publication", "Show the effect of publishing."),
                "regrade-one": Command("batch.regrade:regrade_one", "Grade one submission again."),
                "grade-over-limit": Command(
                    "batch.regrade:grade_over_limit", "Grade a submission that is over a limit."
                ),
            },
        ),
        "assignments": CommandGroup(
            "List, show, check, create and export assignments.",
            {
                "list": Command("assignments.listing:list_assignments", "List the catalogue."),
                "show": Command("assignments.showing:show", "Show the task of an assignment."),
                "check": Command("assignments.checking:check", "Find mistakes in an assignment, grade its examples."),
                "new": Command("assignments.writing:new", "Create the folder of a new assignment."),
                "export": Command("assignments.writing:export", "Export an assignment."),
                "autograder": Command("assignments.writing:autograder", "Create an autograder for Gradescope."),
            },
        ),
        "models": CommandGroup(
            "List, train and evaluate classifiers.",
            {
                "list": Command("models.cards:list_models", "List the classifiers with their accuracy."),
                "train": Command("models.measuring:train", "Train a classifier again."),
                "evaluate": Command("models.measuring:evaluate", "Measure a classifier."),
                "compare": Command("models.cards:compare", "Compare the cards of classifiers."),
            },
        ),
        "floors": Command("floors:floors", "Draw every floor with its scale."),
        "show": Command("show:show", "Show a stored grade."),
        "mark": CommandGroup(
            "Adjust marks and comment for students.",
            {
                "set": Command("marking:set_marks", "Set the marks of a criterion."),
                "excuse": Command("marking:excuse", "Excuse a criterion: it does not count."),
                "withdraw": Command("marking:withdraw", "Restore the grader's marks."),
                "comment": Command("marking:comment", "Write a comment for the student."),
                "uncomment": Command("marking:uncomment", "Remove a comment."),
                "history": Command("marking:history", "Show manual changes and comments, with authors."),
            },
        ),
        "appeals": CommandGroup(
            "List and answer appeals.",
            {
                "list": Command("appeals:list_appeals", "List the open appeals."),
                "answer": Command("appeals:answer", "Answer and close an appeal."),
            },
        ),
        "verify": Command("verify:verify", "Repeat a stored grading and compare, or check a statement."),
        "statement": Command("statements:statement", "Write the signed statement on a published grade."),
        "log": CommandGroup(
            "File and check the log of statements.",
            {
                "head": Command("statements:write_head", "Write the signed head of the log, to be filed elsewhere."),
                "check": Command("statements:check_log", "Check the log and all published grades."),
            },
        ),
        "keys": CommandGroup(
            "Manage the keys that sign statements.",
            {
                "list": Command("statements:list_keys", "List the public keys."),
                "rotate": Command("statements:rotate_key", "Sign with a new key from now on."),
                "revoke": Command("statements:revoke_key", "Revoke a key that others may know."),
            },
        ),
        "course": CommandGroup(
            "Manage courses: policies, students, assignments.",
            {
                "list": Command("course:list_courses", "List the courses."),
                "gradebook": Command("gradebook:gradebook", "Show the grades of a course that count."),
                "policy": Command("course:policy", "Set or show deadline and attempts."),
                "extend": Command("course:extend", "Allow one student more time or attempts."),
                "enrol": Command("course:enrol", "Enrol students before they submit."),
                "prepare": Command("course:prepare", "Add an assignment to a course."),
                "open": Command("course:open_assignment", "Open an assignment for web submissions."),
                "close": Command("course:close_assignment", "Close an assignment for submissions."),
                "remove": Command("course:remove_assignment", "Remove an assignment that no student has seen."),
                "hide-names": Command("course:hide_names", "Hide the students' names of an assignment."),
                "show-names": Command("course:show_names", "Show the students' names of an assignment."),
                "export-student": Command("privacy:export_student", "Export all data of a student."),
                "delete-student": Command("privacy:delete_student", "Delete all data of a student."),
                "purge": Command("privacy:purge_course", "Remove old data of a course."),
            },
        ),
        "user": CommandGroup(
            "Manage people, sign-in links and tokens.",
            {
                "add": Command("user:add", "Add an instructor, an operator or a student."),
                "link": Command("user:link", "Print a sign-in link, which works once."),
                "links": Command("user:links", "Print a sign-in link for each student of a course."),
                "token": Command("user:token", "Print a token for programs."),
                "list": Command("user:list_people", "List the members of a course."),
                "sign-out": Command("user:sign_out", "End a person's links, sessions and tokens."),
                "remove": Command("user:remove", "Remove a person from a course."),
                "join": Command("user:join", "Join two accounts of one person."),
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
        "up": Command("up:up", "Start broker, workers and web server.", serves=True),
        "serve": Command("up:serve", "Start the web server: pages, API, health, metrics.", serves=True),
        "worker": Command("worker:worker", "Start a worker, which grades queued jobs.", serves=True),
        "doctor": Command("doctor:doctor", "Check everything that grading needs on this machine."),
        "db": CommandGroup(
            "Upgrade, back up, restore and clean the database.",
            {
                "upgrade": Command("database:upgrade_tables", "Upgrade the tables to this release."),
                "backup": Command("database:backup_database", "Back up the database while it is in use."),
                "restore": Command("database:restore_database", "Restore a backup into an empty database."),
                "purge": Command("database:purge_database", "Remove old data."),
            },
        ),
        "sandbox": CommandGroup(
            "Test the sandbox for student code.",
            {"check": Command("sandbox:check", "Test the sandbox and list its active layers.")},
        ),
        "demo": Command("demo:demo", "Grade sample submissions through a real worker."),
        "notebook-engine": Command(
            "notebook_engine:notebook_engine", "Run robots and checks for a notebook.", serves=True, hidden=True
        ),
    }
)
